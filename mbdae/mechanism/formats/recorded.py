"""XML elements that record which of their contents were read, so that the rest can be reported.

A reader queries a `Recorded` element for its children, attributes and text; whatever it never queried is not part of
the mechanism. Where another program reads a file (Pinocchio a URDF, MuJoCo an MJCF), `Recorded.mark` takes a table of
the contents that are carried over.
"""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping

from ...errors import InputError, printable
from ..imported_model import name_list

NAME, ALL = "name", "*"


class Recorded:
    """An XML element, and a record of which attributes, children and text were read.

    Attributes:
        tag: of the element.
        names: of the element and its ancestors, without the root's, joined by ``/``.
    """

    def __init__(self, element: ET.Element, above: "Recorded | None" = None) -> None:
        self.tag, self._element, self._above = element.tag, element, above
        own = [element.get(NAME, "")] if above else []
        self.names: str = "/".join(filter(None, [above.names if above else "", *own]))
        self._made: list[Recorded] | None = None
        self._attributes, self._text, self._visited = {NAME}, False, above is None

    @classmethod
    def parse(cls, text: str | bytes, name: str) -> "Recorded":
        """Return the root element of a text.

        Raises:
            InputError: for a text that is not XML.
        """
        try:
            return cls(ET.fromstring(text))
        except (ET.ParseError, ValueError, LookupError) as e:  # LookupError: an unknown encoding
            raise InputError(f"{name} is not XML: {e}") from None

    @property
    def children(self) -> "list[Recorded]":
        """All children; this does not mark them as read."""
        if self._made is None:
            self._made = [Recorded(e, self) for e in self._element]
        return self._made

    def get(self, key: str, default: str = "") -> str:
        """Read an attribute."""
        self._attributes.add(key)
        return self._element.get(key, default)

    def skip_blank(self, key: str) -> None:
        """Mark an attribute as read if it is empty."""
        if not self._element.get(key, "").strip():
            self._attributes.add(key)

    def all(self, tag: str) -> "list[Recorded]":
        """Read all children of one tag."""
        found = [e for e in self.children if e.tag == tag]
        for e in found:
            e._visited = True
        return found

    def first(self, path: str) -> "Recorded | None":
        """Read the first child of a tag, or the first one along a path of tags."""
        at: Recorded | None = self
        for tag in path.split("/"):
            at = next((e for e in at.children if e.tag == tag), None) if at else None
            if at:
                at._visited = True
        return at

    def text(self, path: str = "") -> str | None:
        """Read the text of the element, or of the first one along a path; None if there is none."""
        e = self.first(path) if path else self
        if e is None:
            return None
        e._text = True
        return (e._element.text or "").strip()

    def mark(self, table: Mapping[str, str]) -> None:
        """Mark the contents of a table as read, in the element and all below it.

        Args:
            table: ``"tag"``, or ``"parent/tag"`` where that differs from the rest, and the attributes read, separated
                by
            spaces: ``"*"`` is all of them, ``"**"`` also everything below. A tag followed by ``!`` is read once.
        """
        waiting = [self]
        while waiting:
            at = waiting.pop()
            at._visited = True
            once = set[str]()
            for e in at.children:
                keys = (f"{at.tag}/{e.tag}", f"{at.tag}/{e.tag}!", e.tag, f"{e.tag}!")
                key = next((k for k in keys if k in table), None)
                if key is None or key in once:
                    continue
                if key.endswith("!"):
                    once.add(key)
                e._mark(table[key])
                if table[key] != 2 * ALL:
                    waiting.append(e)

    def _mark(self, attributes: str) -> None:
        self._visited = True
        self._attributes |= {*(self._element.keys() if attributes.startswith(ALL) else attributes.split())}
        if attributes == 2 * ALL:
            waiting = [self]
            while waiting:
                e = waiting.pop()
                e._visited = e._text = True
                e._attributes.update(e._element.keys())
                waiting += e.children

    def unread(self, but: "Collection[Recorded]" = ()) -> Iterator[tuple[str, str]]:
        """Yield path and names, from this element on, of unread contents: elements, attributes (``@``) and text.

        Args:
            but: elements to skip.
        """
        waiting = [(self, "")]
        while waiting:
            at, path = waiting.pop()
            names = at.names.removeprefix(self.names).strip("/")
            if not at._visited:
                yield path, names
                continue
            for key in at._element.keys():  # noqa: SIM118 - an element is not a mapping
                if key not in at._attributes:
                    yield f"{path}/@{key}".strip("/"), names
            written = (at._element.text, *(e._element.tail for e in at.children))
            if any(x and x.strip() for x in written[at._text :]):
                yield f"{path}/text()".strip("/"), names
            waiting += [(e, f"{path}/{e.tag}".strip("/")) for e in reversed(at.children) if e not in but]


def unread_phrases(unread: Iterator[tuple[str, str]]) -> list[str]:
    """Return one phrase for each unread path, with the names of all elements that have it."""
    found: dict[str, dict[str, None]] = {}
    for path, name in unread:
        found.setdefault(printable(path), {})[printable(name)] = None
    return [name_list(f"{path} of", n) if (n := list(filter(None, names))) else path for path, names in found.items()]
