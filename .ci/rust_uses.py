"""Reads the files of a Rust crate: which items their code names, and where those are defined.

No compiler is asked, so that the code of all features and targets is seen at once. `read_crate`
gives the modules, each with the paths in its `use` lines and in its code; `resolve` follows a path
through `use` lines, re-exports, renames and globs to the module that defines the item.

Not seen: methods, which may be implemented in another file than their type, and definitions inside
of functions. An item made by a macro counts as defined in the module that its path leads to. What a
macro names counts for the module of the macro, not for its callers.
"""

import re

DEFINES = {"struct", "enum", "union", "trait", "fn", "const", "static", "type", "macro_rules"}
NO_CODE = re.compile(
    r"""//[^\n]* | /\*.*?\*/
      | (?<!\w)[bc]?r(?P<hash>\#*)".*?"(?P=hash) | (?<!\w)[bc]?"(?:\\.|[^"\\])*"
      | (?<!\w)b?'(?:\\[^\n]+?|[^\\'\n])'""",
    re.DOTALL | re.VERBOSE,
)
TOKEN = re.compile(r"\$?\w+|'\w+|::|\S")
NAME = re.compile(r"[A-Za-z_]\w*$")

ITEMS = set("async const enum extern fn impl macro_rules mod static struct trait type unsafe use".split())


class Module:
    """A module: a file or a `mod x { }` in one. Bindings are ("item",), Module or ("use", path)."""

    def __init__(self, path, file, parent):
        self.path, self.file, self.parent = path, file, parent
        self.names = {}  # What others can name: name -> bindings.
        self.local = {}  # What `use` binds inside of functions.
        self.globs = []
        self.uses = []  # (path, line, is it a glob, does it re-export)
        self.code = []  # Paths in code: (path, line, is it a macro call).

    def bind(self, name, binding, names=None):
        (self.names if names is None else names).setdefault(name, []).append(binding)

    def holds(self, path):
        return path[: len(self.path)] == self.path


class Item:
    """A target that is no module."""

    def __init__(self, module, name):
        self.module, self.name = module, name


# Reading.


def read_crate(src):
    """All modules, the root first, by their paths."""
    modules = {}
    read_file(src / "lib.rs", (), None, modules)
    return modules


def read_file(file, path, parent, modules):
    module = modules[path] = Module(path, file, parent)
    inner = file.parent if file.name in ("lib.rs", "mod.rs") else file.with_suffix("")
    read_items(without_tests(tokens(file.read_text())), module, inner, modules)
    return module


def tokens(text):
    """The code as (token, line); comments and literals are left out."""
    text = NO_CODE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    return [(found[0], line) for line, row in enumerate(text.split("\n"), 1)
            for found in TOKEN.finditer(row)]


def without_tests(toks):
    """Leaves out each item under `#[cfg(test)]` or `#[cfg(all(test, ..))]`."""
    out, i = [], 0
    while i < len(toks):
        if is_attribute(toks, i):
            end = closing(toks, i + 1)
            if is_test_only([t for t, _ in toks[i + 2 : end]]):
                i = end_of_item(toks, end + 1)
                continue
        out.append(toks[i])
        i += 1
    return out


def is_attribute(toks, i):
    return toks[i][0] == "#" and i + 1 < len(toks) and toks[i + 1][0] == "["


def is_test_only(words):
    """`cfg(test)`, or `cfg(all(..))` with `test` itself in it."""
    text = "".join(words)
    if text.startswith("cfg(all("):
        itself = re.sub(r"\w+\([^()]*\)", "", text.removeprefix("cfg(all("))
        return "test" in re.split(r"\W+", itself)
    return text == "cfg(test)"


def closing(toks, i):
    """The index of the bracket that closes the one at `i`."""
    depth = 0
    for j in range(i, len(toks)):
        depth += (toks[j][0] in "([{") - (toks[j][0] in ")]}")
        if depth == 0:
            return j
    raise ValueError(f"line {toks[i][1]}: no closing bracket")


def end_of_item(toks, i):
    """The index behind the item, field or variant that begins at `i`, its attributes included."""
    ends = (";", "{") if starts_item(toks, i) else (";", "{", ",", "}")
    while i < len(toks) and toks[i][0] not in ends:
        i = closing(toks, i) + 1 if toks[i][0] in ("(", "[") else i + 1
    if i >= len(toks) or toks[i][0] in (";", ","):
        return i + 1
    return i if toks[i][0] == "}" else closing(toks, i) + 1


def starts_item(toks, i):
    """Whether a keyword of an item begins at `i`, behind attributes and a visibility."""
    while i < len(toks) and (is_attribute(toks, i) or toks[i][0] in ("pub", "(")):
        i = closing(toks, i + 1 if toks[i][0] == "#" else i) + 1 if toks[i][0] != "pub" else i + 1
    return i < len(toks) and toks[i][0] in ITEMS


def read_items(toks, module, inner, modules):
    """Fills `module` from its tokens. `inner` is the folder of its children."""
    scopes = [module]  # None where a `{` opens something other than a module.
    folders = [inner]
    i = 0
    while i < len(toks):
        token, line = toks[i]
        here = next(scope for scope in reversed(scopes) if scope)
        before = toks[i - 1][0] if i else ";"
        after = toks[i + 1][0] if i + 1 < len(toks) else ""
        if token == "mod" and NAME.match(after):
            path = here.path + (after,)
            if toks[i + 2][0] == ";":
                child = read_child(folders[-1], path, here, modules)
            else:
                child = modules[path] = Module(path, here.file, here)
                scopes.append(child)
                folders.append(folders[-1] / after)
            if child:
                here.bind(after, child)
            i += 3
        elif token == "use" and after != "<":  # `use<'a>` is a bound.
            end = next(j for j in range(i, len(toks)) if toks[j][0] == ";")
            is_public = is_behind_pub(toks, i)
            for leaf in use_tree(toks[i + 1 : end]):
                add_use(here, leaf, is_public, is_local=scopes[-1] is None)
            i = end + 1
        elif token in DEFINES and scopes[-1] and before not in ("<", ",", "*"):
            name = toks[i + 2][0] if token == "macro_rules" else after
            if NAME.match(name) and name not in DEFINES:
                here.bind(name, ("item",))
            # `const fn`: the second word is the definition.
            i += 3 if token == "macro_rules" else 1 if name in DEFINES else 2
        elif token == "{":
            # The braces of a macro call may hold definitions.
            scopes.append(here if before == "!" and scopes[-1] else None)
            folders.append(folders[-1])
            i += 1
        elif token == "}":
            scopes.pop()
            folders.pop()
            i += 1
        elif (NAME.match(token) or token == "$crate") and before not in (".", "::"):
            path, i = path_at(toks, i)
            here.code.append((path, line, i < len(toks) and toks[i][0] == "!"))
        else:
            i += 1


def read_child(folder, path, parent, modules):
    for file in (folder / f"{path[-1]}.rs", folder / path[-1] / "mod.rs"):
        if file.exists():
            return read_file(file, path, parent, modules)
    return None


def is_behind_pub(toks, i):
    """Whether `pub` or `pub(..)` is in front of the token at `i`."""
    words = [t for t, _ in toks[max(0, i - 6) : i]]
    if words and words[-1] == ")":
        words = words[: len(words) - 1 - words[::-1].index("(")]
    return words[-1:] == ["pub"]


def path_at(toks, i):
    path = [toks[i][0]]
    i += 1
    while i + 1 < len(toks) and toks[i][0] == "::" and NAME.match(toks[i + 1][0]):
        path.append(toks[i + 1][0])
        i += 2
    return tuple(path), i


def use_tree(toks):
    """The leaves of a use: (path, name that it binds, line)."""
    leaves, starts, path = [], [()], ()
    rename = None
    for i, (token, line) in enumerate(toks + [(",", 0)]):
        if token == "{":
            starts.append(path)
        elif token in (",", "}"):
            if path != starts[-1]:
                leaves.append((path, rename or path[-1], toks[i - 1][1]))
            if token == "}":
                starts.pop()
            # A group that was closed is no leaf itself.
            path, rename = starts[-1], None
        elif i and toks[i - 1][0] == "as":
            rename = token
        elif token not in ("::", "as"):
            path += (token,)
    return [without_self(leaf) for leaf in leaves]


def without_self(leaf):
    """`a::{self}` names `a`."""
    path, name, line = leaf
    if len(path) > 1 and path[-1] == "self":
        return path[:-1], path[-2] if name == "self" else name, line
    return leaf


def add_use(module, leaf, is_public, is_local):
    path, name, line = leaf
    is_glob = path[-1] == "*"
    if is_glob:
        path = path[:-1]
        module.globs.append(path)
    elif name != "_":
        module.bind(name, ("use", path), module.local if is_local else None)
    module.uses.append((path, line, is_glob, is_public))


# Resolving.


def resolve(module, path, in_code=False, seen=frozenset()):
    """What `path` names, seen from `module`: Modules and Items. Nothing for other crates."""
    if (module.path, path) in seen:
        return []
    seen |= {(module.path, path)}
    first, rest = path[0], path[1:]
    if first in ("crate", "$crate"):
        found = [root_of(module)]
    elif first == "self":
        found = [module]
    elif first == "super":
        found = [module.parent] if module.parent else []
    else:
        found = lookup(module, first, seen)
        if not found and in_code:
            found = bound(module, first, module.local, seen)
    for name in rest:
        found = [there for target in narrowed(found) for there in step(target, name, seen)]
    return found


def root_of(module):
    while module.parent:
        module = module.parent
    return module


def narrowed(found):
    """In front of `::`, a name is that of a module if there is one."""
    return [target for target in found if isinstance(target, Module)] or found


def step(target, name, seen):
    if isinstance(target, Item):
        return [target]
    if name == "super":
        return [target.parent] if target.parent else []
    # A name that is defined nowhere comes out of a macro in that file.
    return lookup(target, name, seen) or [Item(target, name)]


def lookup(module, name, seen):
    found = bound(module, name, module.names, seen)
    if not found:
        for path in module.globs:
            key = (module.path, path, name)
            if key not in seen:
                for target in narrowed(resolve(module, path, seen=seen | {key})):
                    if isinstance(target, Module):
                        found += lookup(target, name, seen | {key})
    return found


def bound(module, name, names, seen):
    found = []
    for binding in names.get(name, []):
        if isinstance(binding, Module):
            found.append(binding)
        elif binding[0] == "item":
            found.append(Item(module, name))
        else:
            found += resolve(module, binding[1], seen=seen)
    return found


def macro_of_ancestor(module, name):
    """Macros are also visible below the module that defines them."""
    while module.parent:
        module = module.parent
        if ("item",) in module.names.get(name, []):
            return [Item(module, name)]
    return []
