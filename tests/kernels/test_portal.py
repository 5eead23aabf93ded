"""The portal against the exam's printed numbers, identities without trigonometry, and round trips.

The exam's figures are in metres; the kernel's in millimetres.
"""

import numpy as np
import pytest
from drillc.kernels import portal
from hypothesis import assume, given
from hypothesis import strategies as st

EXAM = portal.PortalGeometry(10_000.0, 5_000.0, 750.0)
COLUMN = (0.0, 5_000.0)
NORMAL = np.array([[0.5, 0.8138, -0.2962]])
POSITION = np.array([[5500.0, -300.0, -200.0]])
NOTHING = np.zeros(1)

COMPONENT = st.floats(-1.0, 1.0, allow_subnormal=False)
UNIT = (
    st.tuples(COMPONENT, COMPONENT, COMPONENT)
    .filter(lambda v: np.hypot(v[1], v[2]) > 1e-3)
    .map(lambda v: np.array([v]) / np.linalg.norm(v))
)
PLACE = st.tuples(*[st.floats(-9000.0, 9000.0)] * 3).map(lambda v: np.array([v]))
HEIGHT = st.floats(0.0, 5000.0)


def solve(normal, position, branch=0):
    alpha, beta = portal.pointing(normal)
    return portal.offsets(EXAM, position, alpha[:, branch], beta[:, branch]), beta[:, branch]


def interval(off, below=0.0, above=0.0):
    return portal.height_interval(off, COLUMN, COLUMN, COLUMN, NOTHING + below, NOTHING + above)


def test_the_exams_numbers():
    alpha, beta = portal.pointing(NORMAL)
    np.testing.assert_allclose(np.rad2deg(alpha), [[-30.0, -150.0]], atol=5e-3)
    np.testing.assert_allclose(np.rad2deg(beta), [[110.0, -70.0]], atol=5e-3)
    np.testing.assert_allclose(alpha, [[-0.5236, -2.6180]], atol=5e-5)
    np.testing.assert_allclose(beta, [[1.9199, -1.2217]], atol=5e-5)
    assert EXAM.alpha_max_rad == pytest.approx(0.5317, abs=5e-5)
    assert np.rad2deg(EXAM.alpha_max_rad) == pytest.approx(30.4655, abs=5e-5)
    assert EXAM.span_mm == 8500.0
    off, roll = solve(NORMAL, POSITION)
    q = portal.joints(off, roll, np.array([2500.0]))
    printed = [[46.3, 4953.7, 1.9199, 5619.9, 290.5, 2611.4]]
    np.testing.assert_allclose(q, printed, atol=0.05)
    low, high = interval(off)
    np.testing.assert_allclose(portal.widest_margin_mm(low, high), 2500.0, atol=1e-9)


def test_the_hole_that_half_the_height_cannot_reach():
    normal = np.array([[0.25, -0.3, 0.9205976]])
    off, _ = solve(normal, np.array([[8000.0, -600.0, 1900.0]]))
    assert 2500.0 + off.lift_mm[0] == pytest.approx(5331.8, abs=0.05)
    low, high = interval(off)
    assert low[0] == pytest.approx(1097.3, abs=0.05)
    assert high[0] == pytest.approx(2168.2, abs=0.05)
    assert portal.widest_margin_mm(low, high)[0] == pytest.approx(1632.8, abs=0.05)


@given(normal=UNIT, position=PLACE)
def test_the_identities_without_trigonometry(normal, position):
    off, _ = solve(normal, position)
    (nx, ny, nz), (px, py, pz) = normal[0], position[0]
    r, along = np.sqrt(ny * ny + nz * nz), normal[0] @ position[0]
    scale = 1e-9 + 1e-12 / r * np.abs([px, py, pz, EXAM.span_mm]).max()
    assert 2.0 * off.delta_mm[0] == pytest.approx(-EXAM.span_mm * nx / r, abs=scale)
    assert off.lift_mm[0] == pytest.approx(off.delta_mm[0] + along, abs=scale)
    assert off.q5_mm[0] == pytest.approx((py * nz - pz * ny) / r, abs=scale)
    assert off.q4_mm[0] == pytest.approx(750.0 + (px - nx * along) / r, abs=scale)


@given(normal=UNIT, position=PLACE, height=HEIGHT, length=st.sampled_from([1.0, 0.3, 7.0]))
def test_forward_undoes_inverse(normal, position, height, length):
    """The normal's length does not matter, the machine's joints alone give the pose back."""
    off, beta = solve(normal * length, position)
    q = portal.joints(off, beta, np.array([height]))
    assume(abs(off.delta_mm[0]) < 1e6)
    R, t, tool = portal.forward(EXAM, q)
    np.testing.assert_allclose(R[0] @ normal[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(R[0] @ position[0] + t[0], tool[0], atol=1e-6)
    np.testing.assert_allclose(R[0] @ R[0].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R[0]) == pytest.approx(1.0)
    assert t[0].tolist() == [750.0, 0.0, q[0, 0]]


def test_forward_of_a_machine_set_by_hand():
    """Level bar, part rolled a quarter turn: its y axis points up."""
    q = np.array([[1000.0, 1000.0, np.pi / 2, 3000.0, -20.0, 900.0]])
    R, t, tool = portal.forward(EXAM, q)
    np.testing.assert_allclose(R[0] @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(R[0] @ [1, 0, 0], [1, 0, 0], atol=1e-15)
    assert t[0].tolist() == [750.0, 0.0, 1000.0]
    assert tool[0].tolist() == [3000.0, -20.0, 900.0]
    tilted, _, _ = portal.forward(EXAM, np.array([[0.0, 5000.0, 0.0, 0.0, 0.0, 0.0]]))
    bar = tilted[0] @ [1, 0, 0]
    assert bar[2] / bar[0] == pytest.approx(5000.0 / 8500.0)  # q2 above q1: the far end is up


@given(normal=UNIT)
def test_only_the_first_branch_can_stand(normal):
    alpha, beta = portal.pointing(normal)
    assert np.abs(alpha[0, 0]) < np.pi / 2
    assert np.abs(alpha[0, 1]) >= np.pi / 2
    for a, b in zip(alpha[0], beta[0], strict=True):  # yet both satisfy eq. (4)
        ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
        nx, ny, nz = normal[0]
        pointed = [nx * ca + ny * sa * sb + nz * sa * cb, ny * cb - nz * sb]
        pointed.append(-nx * sa + ny * ca * sb + nz * ca * cb)
        np.testing.assert_allclose(pointed, [0, 0, 1], atol=1e-12)
    off, _ = solve(normal, np.array([[1.0, 2.0, 3.0]]), branch=1)
    assert np.isnan([off.delta_mm, off.lift_mm, off.q4_mm, off.q5_mm]).all()
    low, high = interval(off)
    assert np.isnan([low, high]).all()


def test_the_trap_of_the_second_branch():
    """tan(alpha2) by eq. (12) gives q1, q2 in range, but the machine holds the normal downwards."""
    alpha, beta = portal.pointing(NORMAL)
    assert abs(alpha[0, 1]) > EXAM.alpha_max_rad
    half = 0.5 * EXAM.span_mm * np.tan(alpha[0, 1])
    q = np.array([[2500.0 + half, 2500.0 - half, beta[0, 1], 0.0, 0.0, 0.0]])
    assert np.all((q[0, :2] > 0.0) & (q[0, :2] < 5000.0))
    R, _, _ = portal.forward(EXAM, q)
    assert (R[0] @ NORMAL[0])[2] < -0.49
    assert np.isnan(solve(NORMAL, POSITION, branch=1)[0].delta_mm).all()


def test_normals_along_the_bar_have_no_solution_and_nothing_warns():
    normals = np.array([[1.0, 0, 0], [-1.0, -0.0, 0], [0, 0, 0], [np.nan, 0, 1], [0, np.nan, 1]])
    alpha, beta = portal.pointing(normals)
    assert np.isnan(alpha).all()
    assert np.isnan(beta).all()
    off = portal.offsets(EXAM, np.zeros((5, 3)), alpha[:, 0], beta[:, 0])
    assert np.isnan([off.delta_mm, off.lift_mm, off.q4_mm, off.q5_mm]).all()


@pytest.mark.parametrize("y", [0.0, -0.0])
@pytest.mark.parametrize("x", [0.0, -0.0])
def test_signed_zeros_do_not_choose_the_winding(x, y):
    alpha, beta = portal.pointing(np.array([[x, y, -1.0], [x, y, 1.0]]))
    assert alpha.tolist() == [[0.0, np.pi], [0.0, np.pi]]
    assert beta.tolist() == [[np.pi, 0.0], [0.0, np.pi]]
    assert not np.signbit(np.concatenate([alpha, beta])).any()


@given(normal=UNIT, position=PLACE)
def test_the_widest_margin_is_the_checked_formula(normal, position):
    off, _ = solve(normal, position)
    assume(np.abs(off.delta_mm[0]) < 1e5)
    H, delta, lift = 5000.0, abs(off.delta_mm[0]), off.lift_mm[0]
    A, B = max(delta, -lift), max(delta, lift)
    low, high = interval(off)
    assert low[0] == pytest.approx(A, abs=1e-7)
    assert high[0] == pytest.approx(H - B, abs=1e-7)
    middle = portal.widest_margin_mm(low, high)[0]
    assert middle == pytest.approx((H + A - B) / 2, abs=1e-7)
    if abs(lift) <= delta:
        assert middle == pytest.approx(H / 2, abs=1e-7)


@given(
    normal=UNIT,
    position=PLACE,
    limits=st.tuples(*[st.tuples(st.floats(0, 1500), st.floats(3500, 6000))] * 3),
    reach=st.tuples(st.floats(0, 200), st.floats(0, 200)),
)
def test_the_interval_is_where_the_joints_are_inside(normal, position, limits, reach):
    """By trying heights: inside the interval all is within limits, outside something is not."""
    off, beta = solve(normal, position)
    below, above = reach
    low, high = portal.height_interval(off, *limits, NOTHING + below, NOTHING + above)

    def slack(h):
        q1, q2, _, _, _, q6 = portal.joints(off, beta, np.array([h]))[0]
        (l1, u1), (l2, u2), (l6, u6) = limits
        return min(q1 - l1, u1 - q1, q2 - l2, u2 - q2, q6 - below - l6, u6 - q6 - above)

    heights = np.linspace(-3000.0, 8000.0, 221)
    slacks = np.array([slack(h) for h in heights])
    inside = (heights >= low[0]) & (heights <= high[0])
    np.testing.assert_array_equal(inside[np.abs(slacks) > 1e-6], slacks[np.abs(slacks) > 1e-6] >= 0)
    best = slack(portal.widest_margin_mm(low, high)[0])
    assert best >= slacks.max() - 1e-6
    assert best == pytest.approx((high[0] - low[0]) / 2, abs=1e-6 + 1e-12 * abs(best))


def test_an_impossible_tilt_is_an_empty_interval_not_nan():
    steep = np.array([[0.52, 0.0, np.sqrt(1 - 0.52**2)]])
    reachable = np.array([[0.507, 0.0, np.sqrt(1 - 0.507**2)]])
    low, high = interval(solve(steep, np.zeros((1, 3)))[0])
    assert low[0] > high[0]
    low, high = interval(solve(reachable, np.zeros((1, 3)))[0])
    assert low[0] < high[0]


@pytest.mark.parametrize(
    "geometry", [(10.0, 0.0, 1.0), (10.0, 5.0, 5.0), (10.0, 5.0, -1.0), (np.nan, 5.0, 1.0)]
)
def test_an_impossible_portal_is_refused(geometry):
    with pytest.raises(ValueError, match="portal"):
        portal.PortalGeometry(*geometry)
