"""Pack the sources of the runtime of exported mechanisms, for source FMUs.

Run by the build: ``python pack_sources.py LIST FOLDER EIGEN OUT.zip``. LIST has a line "GROUP FILE" for each file of
FOLDER that is compiled; a group is one translation unit. Included headers are searched in FOLDER and in EIGEN.
"""

import re
import sys
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


def included(files: Iterable[Path], folders: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Yield names and paths of files and of their headers in these folders."""
    folders = [folder.resolve() for folder in folders]
    pending, visited = [path.resolve() for path in files], set[Path]()
    while pending:
        path = pending.pop()
        if path in visited:
            continue
        visited.add(path)
        yield next(path.relative_to(f).as_posix() for f in folders if f in path.parents), path
        for name in INCLUDE.findall(path.read_text("utf-8")):
            candidates = (folder / name for folder in (path.parent, *folders))
            pending += [x.resolve() for x in candidates if x.is_file()][:1]


def pack(groups: dict[str, list[Path]], folder: Path, eigen: Path, out: Path) -> None:
    """Write an archive of the sources: one file per group, headers, and the list ``compiled.txt``."""
    listed = [path for paths in groups.values() for path in paths]
    files = {name: path.read_text("utf-8") for name, path in included(listed, (folder, eigen))}
    files["laws.inc"] = "".join(f"LAW({path.stem})\n" for path in groups["laws"])
    for group, paths in groups.items():
        files[f"{group}.cpp"] = "".join(f'#include "{path.relative_to(folder).as_posix()}"\n' for path in paths)
    files["compiled.txt"] = "\n".join(f"{group}.cpp" for group in groups)
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)


def main(listed: str, folder: str, eigen: str, out: str) -> None:
    """Pack the sources."""
    groups: dict[str, list[Path]] = {}
    for line in Path(listed).read_text("utf-8").splitlines():
        group, path = line.split(" ", 1)
        groups.setdefault(group, []).append(Path(path))
    pack(groups, Path(folder), Path(eigen), Path(out))


if __name__ == "__main__":
    main(*sys.argv[1:])
