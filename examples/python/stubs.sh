#!/usr/bin/env bash
# Makes the stubs of the extension from its signatures, with maturin.
#
#   examples/python/stubs.sh           writes axlewire/_axlewire.pyi
#   examples/python/stubs.sh --check   fails if it is not what it would write
set -euo pipefail
cd "$(dirname "$0")"
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
maturin generate-stubs --quiet --out "$made"
{
    echo '# Made by stubs.sh: do not edit.'
    echo 'import os'
    echo 'from collections.abc import Awaitable, Iterable, Iterator, Sequence'
    echo 'from typing import IO, TypeAlias'
    echo 'from typing_extensions import Buffer, CapsuleType'
    echo 'from axlewire._picture import Picture'
    # What maturin cannot know of.
    sed -E -e '/^from types import CapsuleType/d' \
        -e '0,/__match_args__: .*/s//__match_args__ = ("message", "raw")/' \
        -e '/^class Gap/,/__repr__/s/__match_args__: .*/__match_args__ = ("length", "reason")/' \
        -e '/^def __getattr__\(name: str\) -> Incomplete/d' \
        -e 's/-> dict( |:)/-> dict[str, Any]\1/; s/-> list:/-> list[Any]:/' \
        -e 's/__iter__\(self, \/\) -> Any/__iter__(self, \/) -> Iterator[str]/' \
        -e 's/__anext__\(self, \/\) -> Any/__anext__(self, \/) -> Awaitable[Report]/' \
        -e 's/(__exit__.*) -> bool:/\1 -> None:/' \
        -e '0,/^@final$/s//Path: TypeAlias = str | os.PathLike[str]\nSource: TypeAlias = Path | Sequence[Path] | Buffer | IO[bytes]\n\n@final/' \
        "$made/axlewire/_axlewire.pyi"
    printf '\nclass Error(Exception):\n    nodes: list[int]\n'
    for it in StopsOwed StillMoving NotOnline Refused NoAnswer PortLost; do
        printf '\nclass %s(Error): ...\n' $it
    done
} >"$made/_axlewire.pyi"
case ${1-} in
    --check) diff -u axlewire/_axlewire.pyi "$made/_axlewire.pyi" ;;
    *) cp "$made/_axlewire.pyi" axlewire/_axlewire.pyi ;;
esac
