"""Which files a model file may name, and where `package://` leads.

The root of a model's files is the nearest folder above it with a package.xml, else its own folder;
the user's `roots` come on top. `..` may be used inside; what resolves to a place outside, by `..`,
a link or an absolute path, is refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

MANIFEST = "package.xml"


class Folders:
    """The folders in which the files of one model lie."""

    def __init__(self, file: Path, roots: Iterable[str | Path] = ()):
        self.here = file.parent.absolute()
        given = [Path(root).absolute() for root in roots]
        self.package = self._package()
        self.allowed = [*given, self.package or self.here]

    def _package(self) -> Path | None:
        """The nearest folder with a package.xml, from the file's own on upwards."""
        for folder in (self.here, *self.here.parents):
            if (folder / MANIFEST).is_file():
                return folder
        return None

    def holds(self, path: Path) -> bool:
        """Whether a path, its links followed, lies in one of the folders."""
        try:
            return self._inside(path.resolve())
        except (OSError, RuntimeError, ValueError):
            return False

    def find(self, name: str) -> tuple[Path | None, str]:
        """(path, "") of a file that a model names, or (None, why not)."""
        if "\0" in name or not name:
            return None, "its name is empty or holds a NUL"
        for scheme in ("package://", "model://"):
            if name.startswith(scheme):
                return self._packaged(unquote(name[len(scheme) :]))
        if name.startswith("file://"):
            name = unquote(name[len("file://") :])
        elif "://" in name:
            return None, "files are not fetched from elsewhere; give a path"
        found = [self.here / name, *(root / name for root in self.allowed)]
        return self._checked(found if not Path(name).is_absolute() else [Path(name)])

    def _packaged(self, rest: str) -> tuple[Path | None, str]:
        """Of 'name/path/in/it': in a folder called so above the file or in a root."""
        package, _, inside = rest.partition("/")
        tries: list[Path] = []
        for root in self.allowed:
            if root.name == package or root == self.package:
                tries.append(root / inside)
            tries += [root / package / inside, root / inside]
        tries += [p / inside for p in self.here.parents if p.name == package and self._inside(p)]
        return self._checked(tries)

    def _inside(self, path: Path) -> bool:
        return any(path.is_relative_to(root.resolve()) for root in self.allowed)

    def _checked(self, tries: list[Path]) -> tuple[Path | None, str]:
        outside = False
        for path in tries:
            try:
                resolved = path.resolve()
                if not self._inside(resolved):
                    outside = True
                elif resolved.is_file():
                    return resolved, ""
            except (OSError, RuntimeError):  # a circle of links, a name that is too long
                continue
        if outside:
            root = self.package or self.here
            return None, f"it lies outside of {root}; allow its folder with roots=[...]"
        return None, "there is no such file"
