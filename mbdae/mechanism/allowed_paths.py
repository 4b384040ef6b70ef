"""Allowed paths: a model file may name files of its package and of folders given by the user.

A model may come from an untrusted source. The meshes, images and further files that it names are therefore read from
its package only: the nearest parent folder with a ``package.xml``, or otherwise its own folder, or the parent of
folders named as in `LAYOUT`. Links are resolved before this check. ``packages`` of a mechanism file adds folders.

The folders named in a saved run are not trusted: its meshes are read from its own folder, from installed
packages, and from folders given by the user.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from ..discovery import models_directory, robots_directory
from ..errors import InputError

MANIFEST = "package.xml"
LAYOUT = ("urdf", "mjcf", "xml", "meshes", "mesh", "visual", "visuals", "collision", "assets")


class AllowedPaths(NamedTuple):
    """Folders from which the files that a model names may be read.

    Attributes:
        folder: folder of the model file.
        packages: folders given by the user.
        root: package of the file.
        trusted: for a saved run, folders one of which must contain the file, too; None if the user loads the model.
    """

    folder: Path
    packages: tuple[Path, ...] = ()
    trusted: tuple[Path, ...] | None = None

    @classmethod
    def from_model_file(cls, path: Path, packages: Sequence[Path | str] = ()) -> "AllowedPaths":
        """Return the allowed paths of a model file."""
        return cls(path.resolve().parent, tuple(Path(p).resolve() for p in packages))

    @classmethod
    def from_record(cls, folder: str, packages: Sequence[str], meshes: Sequence[Path] | None) -> "AllowedPaths":
        """Return the allowed paths of a recorded imported model.

        Args:
            folder: folder of the model file, from the record.
            packages: folders given by the user who read that file, from the record.
            meshes: folders from which a saved run may read meshes, see `mbdae.mechanism.formats.sources.restored`.
        """
        recorded = tuple(map(Path, packages))
        if meshes is None:
            return cls(Path(folder), recorded)
        given = tuple(p.resolve() for p in meshes)
        return cls(Path(folder), (*recorded, *given), (*given, *installed_folders()))

    @property
    def root(self) -> Path:
        """Package of the file."""
        return package_of(self.folder)

    def find(self, name: str) -> Path:
        """Return the file that a name in the model refers to: a path, or a URI with ``package://`` or ``file://``.

        Characters of a URI may be percent-encoded, as ``%20`` for a space.

        Raises:
            InputError: if it does not exist, or is not allowed.
        """
        outside = None  # a file that exists, but is not allowed
        try:
            uris = (name, unquote(name)) if "://" in name else (name,)
            for candidate in (path for uri in dict.fromkeys(uris) for path in self._candidates(uri)):
                if ".." not in candidate.parts and not candidate.is_file():
                    continue  # resolving it would query every parent folder
                path = candidate.resolve()
                if path.is_file():
                    if self._allows(path):
                        return path
                    outside = outside or path
        except (OSError, ValueError, RuntimeError) as e:  # RuntimeError: circular links
            raise InputError(f"{name[:80]!r} is not a path: {e}") from None
        if outside is not None and not self._is_trusted(outside):
            rule = "meshes of a saved run are read from its folder and from installed packages"
            raise InputError(f"{name!r} is {outside}: {rule}; name further folders by meshes=[...] or --meshes")
        if outside is not None:
            raise access_error(name, outside, self.root)
        raise InputError(f"{name!r} is not found in {', '.join(map(str, (self.root, *self.packages)))}")

    def allows(self, path: Path) -> bool:
        """Return whether a file may be read; links are resolved."""
        return self._allows(path.resolve())

    def _allows(self, path: Path) -> bool:
        contained = any(path.is_relative_to(folder) for folder in (self.root, *self.packages))
        return self._is_trusted(path) and (contained or self._is_in_sibling_package(path))

    def companion_folder(self, mesh: Path) -> Path:
        """Return the folder of the files to which a mesh may refer: its package, within the trusted folders."""
        package = package_of(mesh.parent)
        widest = min(
            (p for p in self.trusted or () if mesh.is_relative_to(p)), key=lambda p: len(p.parts), default=package
        )
        return package if package.is_relative_to(widest) else widest

    def _is_trusted(self, path: Path) -> bool:
        return self.trusted is None or any(path.is_relative_to(folder) for folder in self.trusted)

    def _is_in_sibling_package(self, path: Path) -> bool:
        """Return whether the package of a file is next to that of the model or above, and both have manifests."""
        package = package_of(path.parent)
        is_sibling = package.parent in self.root.parents
        return is_sibling and (self.root / MANIFEST).is_file() and (package / MANIFEST).is_file()

    def _candidates(self, name: str) -> Iterator[Path]:
        scheme, separator, rest = name.partition("://")
        ancestors = (self.folder, *self.folder.parents)
        if not separator:
            yield from (folder / name for folder in (*ancestors, *self.packages))
        elif scheme == "file":
            yield Path(rest)
        elif scheme in ("package", "model"):
            package, _, inner = rest.lstrip("/").partition("/")
            yield from (folder / package / inner for folder in (*self.packages, *ancestors))
            yield from (folder / inner for folder in self.packages if folder.name == package)


def package_of(folder: Path) -> Path:
    """Return the package of a folder."""
    for ancestor in (folder, *folder.parents):
        if (ancestor / MANIFEST).is_file():
            return ancestor
    while folder.name in LAYOUT:
        folder = folder.parent
    return folder


def access_error(name: str, path: Path, root: Path) -> InputError:
    """Return the error for a file that is not allowed."""
    return InputError(f"{name!r} is {path}, outside of {root}: `packages` of a mechanism file adds folders")


def installed_folders() -> list[Path]:
    """Return the folders of installed packages, of mbdae's models and of example-robot-data."""
    packages = [Path(p).resolve() for p in sys.path if Path(p).name in ("site-packages", "dist-packages")]
    with suppress(InputError):
        packages.append(robots_directory().resolve())
    return [*packages, models_directory().resolve()]
