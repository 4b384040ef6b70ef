"""Where files may look: what a model file names is read from its own package and from folders that the user names.

A model may come from a stranger. The meshes, pictures and further files that it names are therefore read from its
package only: the nearest folder above with a ``package.xml``, or else its own folder, or the one above folders called
as in `LAYOUT`. Links are followed before this is asked. ``packages`` of a mechanism file adds folders.

A saved run names its folders itself, so that they say nothing of what may be read: its meshes come from below its own
folder, from installed packages, and from folders that the user names.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError

MANIFEST = "package.xml"
LAYOUT = ("urdf", "mjcf", "xml", "meshes", "mesh", "visual", "visuals", "collision", "assets")


class AllowedPaths(NamedTuple):
    """Folders in which a model's further files are looked up.

    Attributes:
        folder: of the model file.
        packages: folders that the user names.
        root: the package that the file belongs to.
        trusted: of a saved run, folders that files must be in besides; None for what the user names itself.
    """

    folder: Path
    packages: tuple[Path, ...] = ()
    trusted: tuple[Path, ...] | None = None

    @classmethod
    def of(cls, path: Path, packages: Sequence[Path | str] = ()) -> "AllowedPaths":
        """The places of a model file."""
        return cls(path.resolve().parent, tuple(Path(p).resolve() for p in packages))

    @property
    def root(self) -> Path:
        """The package that the file belongs to."""
        return package_of(self.folder)

    def find(self, name: str) -> Path:
        """The file that a name in the model stands for: a path, or ``package://`` and ``file://`` before one.

        Raises:
            InputError: where there is none, or where it stands outside.
        """
        outside = None
        try:
            for candidate in self._candidates(name):
                found = candidate.resolve()
                if found.is_file():
                    if self.holds(found):
                        return found
                    outside = outside or found
        except (OSError, ValueError, RuntimeError) as e:  # RuntimeError: links that lead to each other
            raise InputError(f"{name[:80]!r} is not a path: {e}") from None
        if outside is not None and not self._trusts(outside):
            known = "meshes of a saved run are read from below its folder and from installed packages"
            raise InputError(f"{name!r} is {outside}: {known}; others are named by meshes=[...] or --meshes")
        if outside is not None:
            raise access_error(name, outside, self.root)
        raise InputError(f"{name!r} is not found in {', '.join(map(str, (self.root, *self.packages)))}")

    def holds(self, path: Path) -> bool:
        """Whether a file may be read: links are followed."""
        found = path.resolve()
        places = (self.root, *self.packages, *self._others(found))
        return self._trusts(found) and any(found.is_relative_to(place) for place in places)

    def _trusts(self, path: Path) -> bool:
        return self.trusted is None or any(path.is_relative_to(place) for place in self.trusted)

    def _others(self, path: Path) -> Iterator[Path]:
        """The package of a file beside the model's own, where both say by their manifests that they are packages."""
        package = package_of(path.parent)
        if (self.root / MANIFEST).is_file() and (package / MANIFEST).is_file() and package.parent in self.root.parents:
            yield package

    def _candidates(self, name: str) -> Iterator[Path]:
        scheme, mark, rest = name.partition("://")
        above = [p for p in (self.folder, *self.folder.parents)]
        if not mark:
            yield from (place / name for place in (*above, *self.packages))
        elif scheme == "file":
            yield Path(rest)
        elif scheme in ("package", "model"):
            package, _, inner = rest.lstrip("/").partition("/")
            yield from (place / package / inner for place in (*self.packages, *above))
            yield from (place / inner for place in self.packages if place.name == package)


def package_of(folder: Path) -> Path:
    """The package that a folder belongs to."""
    for above in (folder, *folder.parents):
        if (above / MANIFEST).is_file():
            return above
    while folder.name in LAYOUT:
        folder = folder.parent
    return folder


def access_error(name: str, found: Path, root: Path) -> InputError:
    """What is said of a file outside."""
    return InputError(f"{name!r} is {found}, outside of {root}: `packages` of a mechanism file adds folders")
