"""Robot files: what they describe, and errors that name the line."""

import re
import tomllib
from math import degrees, inf, radians
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.kinematics import catalogue as robots
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.omni import OmniBase
from servogen.robot import model
from servogen.robot.model import Arm, Length
from servogen.toml import file as toml_file

ARM = """\
name = "mine"
convention = "standard"

[lengths_mm]
l1 = 120
l2 = 80.5

[[joint]]
name = "turn"
kind = "turning"
lower_deg = -90
upper_deg = 45
home_deg = 10
speed_deg_s = 60

[[joint]]
name = "slide"
kind = "sliding"
lower_mm = 10
upper_mm = 30

[[row]]
joint = "turn"
theta_deg = 30
d_mm = "l1"
alpha_deg = 90

[[row]]
joint = "slide"
a_mm = "-l2 + 5.5"

[tool]
z_mm = 40
rz_deg = 90
"""


def read(text: str) -> object:
    return robots.robot_of(toml_file.parse(text, "mine.toml"))


def test_a_users_arm_is_what_its_file_says() -> None:
    found = read(ARM)
    assert isinstance(found, Arm)
    turn, slide = found.joints
    assert (turn.lower, turn.upper, turn.home, turn.speed) == pytest.approx(
        (radians(-90), radians(45), radians(10), radians(60))
    )
    assert (slide.kind, slide.lower, slide.upper, slide.home, slide.speed) == (
        "sliding", 0.01, 0.03, 0.01, None,
    )  # fmt: skip
    assert found.rows[0].d == Length((("l1", 1.0),))
    assert found.rows[1].a == Length((("l2", -1.0),), 0.0055)
    assert found.rows[1].a.value(found.length) == pytest.approx(-0.075)
    assert (found.tool.z, found.tool.rz) == pytest.approx((0.04, radians(90)))
    assert (found.dimensions, found.closed_form) == ("user", None)


# the text changed, what it becomes, where the error is, what it says
MISTAKES = [
    ('convention = "standard"', 'convention = "paul"', 2, "is not allowed here"),
    ('convention = "standard"', 'convetion = "standard"', 2, "unknown key 'convetion'"),
    ("l1 = 120", 'l1 = "long"', 5, "is not a number"),
    ('kind = "turning"', 'kind = "screw"', 10, "is not allowed here"),
    ("lower_deg = -90", "lower_mm = -90", 11, "the joint 'turn' is turning: use deg"),
    ("upper_deg = 45", "upper_deg = -91", 8, "are not in order"),
    ("home_deg = 10", "home_deg = 50", 13, "home is outside the limits"),
    ("home_deg = 10", "home = 10", 13, "'home' has no unit"),
    ("speed_deg_s = 60", "speed_deg_s = 0", 14, "out of range"),
    ('name = "slide"', 'name = "turn"', 17, "used twice"),
    ("upper_mm = 30", "", 16, "'upper_mm' is missing"),
    ('joint = "turn"', 'joint = "trun"', 23, "no joint 'trun'"),
    ('joint = "slide"', 'joint = "turn"', 16, "no row uses the joint 'slide'"),
    ('d_mm = "l1"', 'd_mm = "l3"', 25, "no length 'l3'"),
    ('d_mm = "l1"', 'd_mm = "l1 l2"', 25, "is not a length"),
    ('d_mm = "l1"', "d_mm = true", 25, "is not a text"),
    ("z_mm = 40", "z_cm = 40", 33, "write z_mm"),
    ("z_mm = 40", "z_mm = inf", 33, "finite"),
    ("[tool]", "[[mount]]", 32, "'mount' belongs in a file of kind = \"hexapod\", not of arm"),
    ("l1 = 120", "l1 = -120", 5, "-120 is out of range: at least 0 is allowed"),
    ("l1 = 120", "l1 = 1e9", 5, "at most 100000"),
]


@pytest.mark.parametrize(("before", "after", "line", "message"), MISTAKES)
def test_a_mistake_is_refused_at_its_line(before: str, after: str, line: int, message: str) -> None:
    with pytest.raises(InputError) as caught:
        text = ARM.replace(before, after, 1)
        read(
            text.replace("z_mm = 40\nrz_deg = 90\n", "name = 'x'\nx_mm = 1\ny_mm = 2\n")
            if "mount" in after
            else text
        )
    assert message in str(caught.value)
    assert caught.value.location is not None
    assert (caught.value.location.file, caught.value.location.line) == ("mine.toml", line)


def test_an_arm_without_rows_is_told_what_is_missing() -> None:
    with pytest.raises(InputError, match=r"'convention' is missing[\s\S]*like"):
        read('name = "mine"\n')


LIKE = """\
name = "my-rv"
like = "rv-m1"

[lengths_mm]
d5 = 107

[[joint]]
name = "q2"
lower_deg = -30
upper_deg = 100
"""


def test_a_robot_like_another_takes_over_all_that_is_not_written() -> None:
    found, model = read(LIKE), robots.arm("rv-m1")
    assert isinstance(found, Arm)
    assert found.rows == model.rows
    assert found.closed_form == "rv-m1"
    assert found.length == model.length | {"d5": 0.107}
    assert (found.joints[1].lower, found.joints[1].upper) == pytest.approx((radians(-30), radians(100)))
    assert found.joints[2:] == model.joints[2:]
    assert found.dimensions == "user"


@pytest.mark.parametrize(
    ("before", "after", "line", "message"),
    [
        ('"rv-m1"', '"rv-m2"', 2, "unknown robot 'rv-m2'"),
        ('"rv-m1"', '"hexapod"', 2, "is not an arm"),
        ("d5 = 107", "d6 = 107", 5, "has no length 'd6'"),
        ("d5 = 107", "d5_mm = 107", 5, "the unit is in lengths_mm: write d5"),
        ('name = "q2"', 'name = "q7"', 8, "has no joint 'q7'"),
        ("lower_deg = -30", 'kind = "sliding"', 9, "is turning"),
        ("[lengths_mm]", 'convention = "standard"\n[lengths_mm]', 4, "taken from 'rv-m1'"),
    ],
)
def test_a_mistake_in_a_robot_like_another(before: str, after: str, line: int, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(LIKE.replace(before, after, 1))
    assert message in str(caught.value)
    assert caught.value.location is not None
    assert caught.value.location.line == line


def test_home_goes_back_within_limits_that_leave_it_out() -> None:
    found = read('name = "n"\nlike = "rv-m1"\n[[joint]]\nname = "q1"\nupper_deg = 45\n')
    assert isinstance(found, Arm)
    assert found.joints[0].home == 0.0


def test_a_users_hexapod_has_its_own_mounts_and_leg_lengths() -> None:
    mounts = '[[mount]]\nname = "A"\nx_mm = 10\ny_mm = 20\n'
    mounts += '[[mount]]\nname = "B"\nx_mm = 1\ny_mm = 2\nmirrored = true\n'
    found = read('name = "six"\nkind = "hexapod"\nleg = "pantograph"\n[lengths_mm]\nbc = 70\n' + mounts)
    assert isinstance(found, Hexapod)
    assert found.leg.length["bc"] == pytest.approx(0.07)
    assert [(mount.name, mount.x, mount.mirrored) for mount in found.mounts] == [
        ("A", 0.01, False),
        ("B", 0.001, True),
    ]
    heavy = read(
        'name = "six"\nkind = "hexapod"\nleg = "pantograph"\ncentre_of_mass_mm = [10, -20, 5]\nmass_g = 900\n'
        + mounts
    )
    assert isinstance(heavy, Hexapod)
    assert heavy.centre_of_mass == pytest.approx((0.01, -0.02, 0.005))
    assert (heavy.mass, found.centre_of_mass) == (0.9, (0, 0, 0))
    like = read('name = "six"\nkind = "hexapod"\nlike = "hexapod"\n[lengths_mm]\nbc = 70\n')
    assert isinstance(like, Hexapod)
    assert len(like.mounts) == 6
    with pytest.raises(InputError, match="needs its legs"):
        read('name = "six"\nkind = "hexapod"\nleg = "pantograph"\n')
    with pytest.raises(InputError, match="is not a kind of leg"):
        read('name = "six"\nkind = "hexapod"\nleg = "scara"\n' + mounts)


@pytest.mark.parametrize(
    ("lengths", "says"), [("bc = 0", "bc is 0"), ("ab = 0\ncd = 0", "ab and cd are both 0")]
)
def test_a_leg_without_a_thigh_or_a_reach_is_none(lengths: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        read(f'name = "six"\nkind = "hexapod"\nlike = "hexapod"\n[lengths_mm]\n{lengths}\n')
    assert caught.value.location is not None and caught.value.location.line == 5


def test_an_omni_base_needs_its_wheels() -> None:
    text = 'name = "o"\nkind = "omni"\nwheel_diameter_mm = 60\nwheel_distance_mm = 100\n'
    found = read(text)
    assert isinstance(found, OmniBase)
    assert (found.wheel_radius, found.wheel_distance) == pytest.approx((0.03, 0.1))
    with pytest.raises(InputError, match="'wheel_distance_mm' is missing"):
        read(text.replace("wheel_distance_mm = 100\n", ""))


def test_a_path_that_ends_in_toml_is_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(ARM, "utf-8")
    assert robots.robot(str(path)).name == "mine"
    with pytest.raises(InputError, match="cannot be read"):
        robots.robot(str(tmp_path / "none.toml"))


PAGE = Path(__file__).parents[2] / "docs" / "robots.md"
NAMES = sorted(re.findall(r"^\| `([\w-]+)` \|(?:[^|]*\|){5}$", PAGE.read_text(), re.MULTILINE))
"""The robots of the page's table, which was written by hand."""


def test_the_catalogue_holds_every_robot_of_the_table() -> None:
    assert list(robots.names()) == NAMES and {"scara", "leg", "omni"} < set(NAMES)
    for name in NAMES:
        found = robots.robot(name)
        assert found.name == name
        assert found.title
        assert found.dimensions in ("source", "manufacturer", "example")


def test_other_names_of_the_same_robots() -> None:
    for alias, name in (
        ("RV-M1", "rv-m1"),
        ("rv_m1", "rv-m1"),
        ("robotino", "omni"),
        ("2RP3R", "spherical-wrist"),
    ):
        assert robots.robot(alias) is robots.robot(name)
    with pytest.raises(InputError, match="did you mean 'leg'"):
        robots.robot("legg")
    files = (Path(model.__file__).parent / "catalogue" / "robots").glob("*.toml")
    aliases = [alias for each in files for alias in tomllib.loads(each.read_text("utf-8")).get("aliases", ())]
    assert len({*aliases, *NAMES}) == len(aliases) + len(NAMES), "a name of two robots"


def test_homes_and_limits_of_the_specification() -> None:
    homes = {name: robots.arm(name).home for name in ("theta-r", "theta1-theta2", "rv-m1")}
    assert homes["theta-r"][0] == pytest.approx(radians(90))
    assert homes["theta1-theta2"] == (0, 0)
    assert homes["rv-m1"] == pytest.approx((radians(90), 0, 0, 0, radians(90)))
    one, two, three, four = robots.arm("scara").joints
    assert (one.upper, two.upper, three.upper, four.upper) == pytest.approx(
        (radians(120), radians(132.5), 0.2, radians(180))
    )
    assert (one.speed, two.speed, three.speed, four.speed) == pytest.approx(
        (radians(112.5), radians(114.5), 0.2, radians(225))
    )
    assert robots.arm("scara").reference == (0, 0, 0, 0)
    assert robots.arm("spherical").reference == (0, 0, 0.1)
    assert all(joint.upper < inf for name in NAMES[:2] for joint in robots.arm(name).joints)


def test_other_lengths_of_an_arm() -> None:
    changed = robots.arm("rv-m1").with_lengths(d5=0.1)
    assert (changed.length["d5"], changed.dimensions) == (0.1, "user")
    with pytest.raises(InputError, match="rv-m1 has no length 'd9'"):
        robots.arm("rv-m1").with_lengths(d9=0.1)


def test_the_rv_m1_turns_as_far_as_its_maker_says() -> None:
    # Movemaster EX RV-M1: waist 300°, shoulder 130°, elbow 110°, wrist pitch ±90°, wrist roll ±180°
    joints = robots.arm("rv-m1").joints
    assert [round(degrees(joint.upper - joint.lower)) for joint in joints] == [300, 130, 110, 180, 360]
    # in the angles of its rows: the waist about home, the pitch about the line of the forearm (q4 = 90°)
    ends = [(round(degrees(joint.lower)), round(degrees(joint.upper))) for joint in joints]
    assert ends == [(-60, 240), (-30, 100), (-110, 0), (0, 180), (-180, 180)]
    assert all(joint.lower <= joint.home <= joint.upper for joint in joints)


def test_the_rv_m1_file_says_what_of_its_limits_is_assumed() -> None:
    text = (Path(model.__file__).parent / "catalogue" / "robots" / "rv-m1.toml").read_text("utf-8")
    assert "is assumed" in text
    assert "was not at hand" in text


@pytest.mark.parametrize(
    ("keys", "refused"),
    [
        ('orientation = ["roll"]', "roll of own is not defined"),
        ('orientation = ["pitch"]\nclosed_form = "rv-m1"', "pitch of own is not defined"),
        ('orientation = ["rpy"]', ""),
        ("", ""),
    ],
)
def test_a_roll_is_defined_by_a_closed_form_only(keys: str, refused: str) -> None:
    text = (
        f'name = "own"\nconvention = "standard"\n{keys}\n[[joint]]\nname = "q1"\n'
        '[[row]]\njoint = "q1"\na_mm = 90\n'
    )
    if not refused:
        assert isinstance(read(text), Arm)
        return
    with pytest.raises(InputError, match=refused) as caught:
        read(text)
    assert caught.value.location is not None and caught.value.location.line == 3
