"""The table of methods as Python and notebooks show it."""

import mbdae


def test_methods_are_shown_as_a_table():
    head, *lines = repr(mbdae.METHODS).splitlines()
    assert head.split()[:3] == ["name", "family", "order"]
    assert [line.split()[0] for line in lines] == list(mbdae.METHODS)
    assert {len(line) for line in (head, *lines)} == {len(head)}
    assert lines[list(mbdae.METHODS).index("radau5")].split()[1:6] == ["Radau", "IIA", "5", "5", "3"]
    html = mbdae.METHODS._repr_html_()
    assert html.count("<tr>") == len(mbdae.METHODS) + 1
