"""Builds that are made often and thrown away, and programs that must not outlive their time."""

import os
import resource
import shutil
import signal
import subprocess
import tempfile

MEMORY_BYTES = 8 << 30


def build_environment(target):
    """Of a cargo that builds quickly into this folder: no debug info, lld if there is one."""
    flags = "--cap-lints allow" + " -Clink-arg=-fuse-ld=lld" * bool(shutil.which("ld.lld"))
    return os.environ | {
        "CARGO_TARGET_DIR": str(target), "RUSTFLAGS": flags, "CARGO_PROFILE_DEV_DEBUG": "none",
        "CARGO_INCREMENTAL": "1", "CARGO_TERM_COLOR": "never",
        "PROPTEST_DISABLE_FAILURE_PERSISTENCE": "1"}


def finish(command, patience_s, **options):
    """Runs it, and ends all that it started: its status (`None` if it was late) and its errors."""
    # Not a pipe: what it has started and left would keep that open.
    with tempfile.TemporaryFile() as errors:
        run = subprocess.Popen(command, start_new_session=True, stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=errors, **options)
        try:
            status = run.wait(patience_s)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            try:
                os.killpg(run.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            run.wait()
        errors.seek(0)
        return status, errors.read().decode(errors="replace")


def limit_memory():
    """For a `preexec_fn`: a program that takes ever more memory fails, and leaves no core."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
