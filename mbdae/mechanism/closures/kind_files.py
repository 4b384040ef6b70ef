"""Kinds of closures, parsed from the files of `mbdae.mechanism.closures.kinds`, which are imported on first use."""

import re
from typing import NamedTuple

from ...discovery import texts


class KindFile(NamedTuple):
    """Contents of the file of a kind.

    Attributes:
        module: dotted name.
        kind: name of the kind.
        first: first line of the documentation of its class.
        creators: names of further functions that create a closure of this kind.
    """

    module: str
    kind: str
    first: str
    creators: list[str]


def _read(module: str, text: str) -> KindFile:
    kind = re.search(r'^class .*\n    """(.*?)\.?(?:"""|\n)[\s\S]*?^    kind: Literal\["(\w+)"\]', text, re.M)
    if not kind:
        raise TypeError(f"{module} defines no kind of closure")
    creators = re.findall(r"^    @classmethod\n    def ([a-z]\w*)\(", text, re.M)
    return KindFile(module, kind[2], kind[1], [name for name in creators if name != "create"])


KIND_FILES = [_read(module, text) for module, text in texts(f"{__package__}.kinds").items()]
