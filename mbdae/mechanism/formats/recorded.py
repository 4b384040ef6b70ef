"""XML elements that record which of their contents were read, to report the remaining contents.

A reader queries a `Recorded` element for children, attributes and text; contents that it does not query are not part of
the mechanism. If another program reads the file (Pinocchio a URDF, MuJoCo an MJCF), `Recorded.mark` marks the contents
that are carried over, from a table.
"""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping

from ...errors import InputError, printable
from ..imported_model import name_list

NAME, ALL = "name", "*"


class Recorded:
    """An XML element, and a record of which attributes, children and text were read.

    Attributes:
        tag: tag of the element.
        names: names of the element and its ancestors except the root, joined by ``/``.
    """

    def __init__(self, element: ET.Element, parent: "Recorded | None" = None) -> None:
        self.tag, self._element, self._parent = element.tag, element, parent
        local = [element.get(NAME, "")] if parent else []
        self.names: str = "/".join(filter(None, [parent.names if parent else "", *local]))
        self._children: list[Recorded] | None = None
        self._attributes, self._text, self._visited = {NAME}, False, parent is None

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
        """All children, without marking them as read."""
        if self._children is None:
            self._children = [Recorded(e, self) for e in self._element]
        return self._children

    def get(self, key: str, default: str = "") -> str:
        """Read an attribute."""
        self._attributes.add(key)
        return self._element.get(key, default)

    def skip_blank(self, key: str) -> None:
        """Mark an attribute as read if it is empty."""
        if not self._element.get(key, "").strip():
            self._attributes.add(key)

    def all(self, tag: str) -> "list[Recorded]":
        """Read all children with a tag."""
        found = [e for e in self.children if e.tag == tag]
        for e in found:
            e._visited = True
        return found

    def first(self, path: str) -> "Recorded | None":
        """Read the first child with a tag, or the first element along a path of tags."""
        element: Recorded | None = self
        for tag in path.split("/"):
            element = next((e for e in element.children if e.tag == tag), None) if element else None
            if element:
                element._visited = True
        return element

    def text(self, path: str = "") -> str | None:
        """Read the text of the element, or of the first element along a path; None if it does not exist."""
        e = self.first(path) if path else self
        if e is None:
            return None
        e._text = True
        return (e._element.text or "").strip()

    def mark(self, table: Mapping[str, str]) -> None:
        """Mark contents of the element and its descendants as read.

        Args:
            table: attributes that are read, separated by spaces, by ``"tag"``, or by ``"parent/tag"`` if this differs:
                ``"*"`` means all attributes, ``"**"`` also all descendants. A tag followed by ``!`` is read once.
        """
        waiting = [self]
        while waiting:
            element = waiting.pop()
            element._visited = True
            seen = set[str]()
            for e in element.children:
                keys = (f"{element.tag}/{e.tag}", f"{element.tag}/{e.tag}!", e.tag, f"{e.tag}!")
                key = next((k for k in keys if k in table), None)
                if key is None or key in seen:
                    continue
                if key.endswith("!"):
                    seen.add(key)
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

    def unread(self, skip: "Collection[Recorded]" = ()) -> Iterator[tuple[str, str]]:
        """Yield relative path and names of unread contents: elements, attributes (``@``) and text.

        Args:
            skip: elements to skip.
        """
        waiting = [(self, "")]
        while waiting:
            element, path = waiting.pop()
            names = element.names.removeprefix(self.names).strip("/")
            if not element._visited:
                yield path, names
                continue
            for key in element._element.keys():  # noqa: SIM118 - an element is not a mapping
                if key not in element._attributes:
                    yield f"{path}/@{key}".strip("/"), names
            written = (element._element.text, *(e._element.tail for e in element.children))
            if any(x and x.strip() for x in written[element._text :]):
                yield f"{path}/text()".strip("/"), names
            waiting += [(e, f"{path}/{e.tag}".strip("/")) for e in reversed(element.children) if e not in skip]


def unread_phrases(unread: Iterator[tuple[str, str]]) -> list[str]:
    """Return one phrase for each unread path, with the names of all its elements."""
    found: dict[str, dict[str, None]] = {}
    for path, name in unread:
        found.setdefault(printable(path), {})[printable(name)] = None
    return [name_list(f"{path} of", n) if (n := list(filter(None, names))) else path for path, names in found.items()]
