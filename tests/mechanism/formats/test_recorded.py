"""Which contents of an XML element were read is known, and the rest is named."""

import pytest

from mbdae.errors import InputError
from mbdae.mechanism.formats.recorded import Recorded, unread_phrases

TEXT = """<robot name="r" owner="me">
<link name="a" colour="red"><mass>1</mass><mass>2</mass><shape><box size="1" of="x"/></shape></link>
<link name="b"><mass>3</mass>loose</link></robot>"""


def test_what_is_never_asked_for_is_named_by_path():
    robot = Recorded.parse(TEXT, "r.xml")
    assert unread_phrases(robot.unread()) == ["@owner", "link of a, b"]
    assert [e.text("mass") for e in robot.all("link")] == ["1", "3"]
    said = ["@owner", "link/@colour of a", "link/mass of a", "link/shape of a", "link/text() of b"]
    assert unread_phrases(robot.unread()) == said
    robot.get("owner")
    assert robot.first("link/shape/box").get("size") == "1"
    assert unread_phrases(robot.unread()) == [
        "link/@colour of a",
        "link/mass of a",
        "link/shape/box/@of of a",
        *said[4:],
    ]


def test_a_table_marks_what_another_program_reads():
    robot = Recorded.parse(TEXT, "r.xml")
    robot.mark({"link": "colour", "mass!": "", "robot/shape": "**"})
    assert unread_phrases(robot.unread()) == ["@owner", "link/mass/text() of a, b", "link/mass of a", "link/shape of a",
                                              "link/text() of b"]  # fmt: skip
    robot.mark({"link": "*", "mass": "**", "link/shape": "**"})
    assert unread_phrases(robot.unread()) == ["@owner", "link/text() of b"]


def test_a_text_that_is_no_xml_is_rejected():
    with pytest.raises(InputError, match=r"^r\.xml is not XML: "):
        Recorded.parse("<robot>", "r.xml")
