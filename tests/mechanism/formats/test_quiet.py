"""Where omitted contents of a file are reported: in a warning, or in info only."""

from pathlib import Path

import pytest

import mbdae

ROBOT = Path(__file__).parents[2] / "data" / "robot" / "robot.urdf"


@pytest.mark.filterwarnings("ignore:.*not carried over")
def test_what_the_urdf_of_a_robot_yaml_says_is_named_too(tmp_path):
    text = ROBOT.read_text().replace("</robot>", "<gazebo/></robot>")
    (tmp_path / "robot.urdf").write_text(text)
    (tmp_path / "robot.yaml").write_text("Lidmot: [0, 1]\nname_mot: motor")
    left_out = mbdae.load(tmp_path).left_out
    assert {"gazebo", "keys of robot.yaml Lidmot"} <= set(left_out)
    assert any(text.startswith("limits of joints motor_left, ") for text in left_out)


@pytest.mark.filterwarnings("error")
def test_a_quiet_source_is_named_in_info_only(tmp_path):
    (tmp_path / "robot.urdf").write_text(ROBOT.read_text())
    file = tmp_path / "mechanism.toml"
    file.write_text('source = { file = "robot.urdf", quiet = true }')
    quiet = mbdae.load(file)
    assert any(text.startswith("limits of joints motor_left, ") for text in quiet.left_out)
    assert "limits of joints motor_left, " in " ".join(str(mbdae.info(quiet)).split())
    two = '[[source]]\nfile = "robot.urdf"\nquiet = true\nprefix = "a_"\n[[source]]\nfile = "robot.urdf"\nprefix = "b_"'
    file.write_text(two)
    with pytest.warns(UserWarning, match="not carried over: b_: limits") as said:
        mbdae.load(file)
    assert ": a_: " not in str(said[0].message)
    assert "; a_: " not in str(said[0].message)
