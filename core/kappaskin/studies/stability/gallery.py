"""Gallery of hard cases.

Where a case does not say otherwise, 40 frames are read of a shape whose every function bends the
skin equally, by about 0.3 1/m, with Gaussian noise of the paper's 0.231 1/m; all seeded.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from kappaskin.bases import Basis, CurvatureMap, SineBasis, basis_for
from kappaskin.estimation import FiniteSlopeLeastSquares
from kappaskin.frames import COMPONENTS, Array
from kappaskin.mechanics import DiscLoad, Plate, PointLoad, Stretching
from kappaskin.scenes import TABLE_1_NOISE, scaled_to
from kappaskin.sensing import SensorLayout, Transduction
from kappaskin.skin import Cap, Patch
from kappaskin.studies.accuracy import root_mean_square
from kappaskin.studies.paper import RADIUS

FRAMES = 40
"""Frames of a case, each with its own noise: an error bar is judged by all of them."""

SEED = 8
_BENDS = 0.3  # 1/m by each function: slopes are then too slight to matter


class CaseKind(Enum):
    """Requirements of a case; they determine which methods support it."""

    ANY = "any method that takes the skin"
    LINEAR = "readings as a skin of slight slope gives them, to more digits than slopes allow"
    SLOPES = "readings of a skin with slopes near one"
    SEQUENCE = "more frames than a method that solves each anew is asked for"
    DENSE = "as many functions as dense algebra does quickly, but nothing slower"
    OUTLIERS = "so many bad readings that only a method which excludes them is asked for a shape"
    LARGE = "more functions than a dense matrix is made for"
    GIVEN = "a sigma that the readings contradict, which the answer must say"
    DRIFT = "readings that drift, of which the live estimate takes the drift out"


@dataclass(frozen=True, eq=False)
class HardCase:
    """`curvature` (T, 3, P) in 1/m, read of the shape with coefficients `truth` in m.

    Or other readings (T, R), in their units.
    `truth` is (Ri, Rj), or (T, Ri, Rj) of a shape that moves, of the functions of `true_basis`.
    `hard` is one sentence on what is hard; `announced` why an answer may be less than exact, or
    none; empty where nothing excuses it. `sigma` in 1/m, or (R,), is the noise, where it is given.
    """

    name: str
    hard: str
    basis: Basis
    layout: SensorLayout
    true_basis: Basis
    truth: Array
    curvature: Array
    announced: str = ""
    kind: CaseKind = CaseKind.ANY
    sigma: float | Array | None = None

    @property
    def in_reach(self) -> bool:
        """Whether the functions that are fitted can be the truth."""
        return self.true_basis == self.basis


def case_of(
    name: str,
    hard: str,
    layout: SensorLayout,
    functions: tuple[int, int],
    *,
    announced: str = "",
    noise: float | Array = TABLE_1_NOISE,
    kind: CaseKind = CaseKind.ANY,
    basis: Basis | None = None,
    true_basis: Basis | None = None,
    truth: Array | None = None,
    spoilt: Callable[[Array], Array] = lambda K: K,
    sigma: float | Array | None = None,
) -> HardCase:
    """A case of `functions` on a `layout`; `spoilt` makes of clean, noisy readings what comes."""
    rng = np.random.default_rng(SEED)
    basis = SineBasis(layout.patch, *functions) if basis is None else basis
    true_basis = basis if true_basis is None else true_basis
    M = layout.operator(true_basis)
    c = _even(true_basis, M, rng) if truth is None else truth
    clean = np.dot(c.reshape(-1, true_basis.size), M.T).reshape(-1, *layout.frame_shape)
    frames = (FRAMES if len(clean) == 1 else len(clean)) if np.any(noise) else 1
    K = clean + rng.normal(0.0, noise, (frames, *layout.frame_shape))
    return HardCase(name, hard, basis, layout, true_basis, c, spoilt(K), announced, kind, sigma)


def _even(basis: Basis, M: Array, rng: np.random.Generator) -> Array:
    """Coefficients (Ni, Nj) of which each function that is free bends the skin alike."""
    W = np.eye(basis.size) if basis.free is None else basis.free
    A = M @ W
    length = np.linalg.norm(A, axis=0) / math.sqrt(len(A))
    length[length <= 1e-9 * length.max(initial=1.0)] = np.inf  # it would move without bending
    return (W @ (_BENDS * rng.normal(size=len(length)) / length)).reshape(basis.shape)


_PATTERNS = 4  # of missing readings
_SQUARE = Patch(0.1, 0.1)
_TENS = SensorLayout.regular(_SQUARE, 10, 10)


def _dent(functions: int) -> Array:
    """A dent of 1 mm, in so many functions along each side."""
    basis, load = SineBasis(_SQUARE, functions, functions), PointLoad(0.04, 0.06)
    return Plate(_SQUARE).deflection([scaled_to(Plate(_SQUARE), load, 1e-3, basis)], basis)


def _sizes() -> Iterator[HardCase]:
    yield case_of("paper", "nothing: the paper's grid and basis, to compare with", _TENS, (8, 8))
    yield case_of(
        "paper, exact",
        "nothing, and readings without noise: only rounding is left",
        _TENS,
        (8, 8),
        noise=0,
        kind=CaseKind.LINEAR,
    )
    yield case_of(
        "Ni = m",
        "the last function has another norm: its cosine vanishes at every element",
        _TENS,
        (10, 10),
    )
    yield case_of(
        "Ni > m",
        "functions 11 and 12 look like 9 and 8 in each channel; three channels distinguish them",
        _TENS,
        (12, 10),
    )
    yield case_of(
        "Ni > m, Nj > n",
        "four mixtures of functions beyond the elements change no reading",
        _TENS,
        (12, 12),
        truth=_dent(12),
        announced="140 of 144 coefficients are determined",
    )
    yield case_of(
        "Ni > m, Nj > n, exact",
        "the same without noise: rounding alone fills what is not determined",
        _TENS,
        (12, 12),
        truth=_dent(12),
        noise=0,
        kind=CaseKind.LINEAR,
        announced="140 of 144 coefficients are determined",
    )
    yield case_of(
        "Ni = 2m",
        "a function that is zero at every element is observable by its twist only",
        _TENS,
        (20, 8),
        kind=CaseKind.DENSE,
    )
    yield case_of(
        "Ni = 2m, Nj = 2n",
        "400 coefficients of 300 readings",
        _TENS,
        (20, 20),
        truth=_dent(20),
        announced="there are fewer readings than coefficients",
        kind=CaseKind.DENSE,
    )
    yield case_of(
        "Ni = 64",
        "unscaled, the lengths of the columns differ by a factor of thousands",
        SensorLayout.regular(Patch(0.5, 0.5), 65, 3),
        (64, 2),
        kind=CaseKind.DENSE,
    )
    yield case_of(
        "16 x 16",
        "256 unknowns of 867 readings, by dense algebra",
        SensorLayout.regular(_SQUARE, 17, 17),
        (16, 16),
        kind=CaseKind.DENSE,
    )


def _arcs() -> Iterator[HardCase]:
    patch = Patch(math.pi * RADIUS, 0.02, RADIUS, strip=True)
    layout = SensorLayout.regular(patch, 10, 1)
    hard = "sin(theta) moves half a circle as a whole and has no curvature: its column is zero"
    pinned = SineBasis(patch, 8, 1)
    a0 = 0.63e-3 / 4
    dent = np.zeros((8, 1))
    dent[0], dent[2] = a0, -3 * a0
    yield case_of("fingertip, exact", f"{hard}; pinned ends decide it", layout, (8, 1), truth=dent,
                  noise=0, kind=CaseKind.LINEAR)  # fmt: skip
    yield case_of("fingertip", f"{hard}; pinned ends decide it, noise of 4.5 1/m", layout, (8, 1),
                  truth=dent, noise=4.5, basis=pinned)  # fmt: skip
    yield case_of(
        "fingertip, free ends",
        f"{hard}; nothing determines it",
        layout,
        (8, 1),
        basis=SineBasis(patch, 8, 1, sliding=True),
        announced="no reading depends on the position of the skin as a whole",
    )


def _domes() -> Iterator[HardCase]:
    dome, saddle = (Patch(0.02, 0.02, radii) for radii in ((0.05, 0.05), (0.05, -0.05)))
    read = SensorLayout.regular(dome, 8, 8)
    yield case_of("dome, dead row", "a row of eight elements of a dome reads nothing",
                  read.without(range(24, 32)), (6, 6))  # fmt: skip
    yield _pressed("dome, load at the rim", "1.5 mm from the rim of a dome, which gives near the "
                   "load only", read, SineBasis(dome, 24, 24), DiscLoad(1.5e-3, 0.01, 1e-3),
                   SineBasis(dome, 7, 7))  # fmt: skip
    yield _pressed("saddle", "a load on a saddle, whose widest waves do not stretch it",
                   replace(read, patch=saddle), SineBasis(saddle, 24, 24),
                   DiscLoad(8e-3, 0.011, 1e-3), SineBasis(saddle, 7, 7))  # fmt: skip
    uneven = Patch(0.02, 0.02, (0.046, 5.0))
    yield case_of("radii of 46 mm and 5 m", "bent a hundred times as much along x as along y",
                  replace(read, patch=uneven), (7, 7))  # fmt: skip
    cap = Cap(0.008, math.radians(75))
    rings, few = SensorLayout.on_rings(cap, (1, 6, 12, 18, 23)), basis_for(cap, "clamped", 4, 7)
    load = scaled_to(Plate(cap), DiscLoad(6e-3, 8e-3, 2e-3), 1e-4, few)
    moved = Plate(cap).deflection([load], few)
    yield case_of("cap, dead ring", "a ring of 18 elements of a cap of 60 reads nothing",
                  rings.without(range(19, 37)), few.shape, basis=few, truth=moved)  # fmt: skip
    x, y = (rings.positions - cap.rim_radius).T
    seam = rings.without(np.flatnonzero((np.abs(np.arctan2(y, x)) < 0.35) & (np.hypot(x, y) > 0)))
    yield case_of("cap, seam", "no element reads within 20 degrees of a line from pole to rim",
                  seam, few.shape, basis=few, truth=moved)  # fmt: skip
    near_rim = DiscLoad(2e-3, cap.rim_radius, 1e-3)
    yield _pressed("cap, load at the rim", "2 mm from the rim of a cap, outside all elements but "
                   "those of the last ring", rings, basis_for(cap, "clamped", 12, 25), near_rim,
                   basis_for(cap, "clamped", 6, 9))  # fmt: skip


def _pressed(
    name: str, hard: str, layout: SensorLayout, finest: Basis, load: DiscLoad, fitted: Basis
) -> HardCase:
    """A load that moves a skin by 0.1 mm, of the functions `finest`, of which some are fitted."""
    plate = Plate(finest.patch)
    truth = plate.deflection([scaled_to(plate, load, 1e-4, finest)], finest)
    return case_of(name, f"{hard}; coarse functions follow fine ones", layout, fitted.shape,
                   basis=fitted, true_basis=finest, truth=truth, kind=CaseKind.LINEAR)  # fmt: skip


def _loads() -> Iterator[HardCase]:
    places = {
        "load near an edge": (5e-4, 0.04, "0.5 mm from an edge, between it and the first element"),
        "load near a corner": (2e-3, 2e-3, "2 mm from both edges of a corner"),
        "load on an element": (0.045, 0.055, "right on an element, where the peak is read"),
        "load between elements": (0.05, 0.05, "between four elements, none of which reads it"),
    }
    fine = SineBasis(_SQUARE, 15, 15)
    for name, (x, y, where) in places.items():
        w = Plate(_SQUARE).deflection([PointLoad(x, y)], fine)
        peak = np.abs(fine.on_grid(*_SQUARE.grid(101, 101))(w)).max()
        yield case_of(
            name,
            f"{where}; curvature peaks there, and 8 x 8 functions cannot follow 15 x 15",
            _TENS,
            (8, 8),
            true_basis=fine,
            truth=1e-3 * w / peak,
            kind=CaseKind.LINEAR,
        )
    plate, finest = Plate(_SQUARE), SineBasis(_SQUARE, 60, 60)
    resolved = {
        "point load, summed": ([PointLoad(0.031, 0.052)], "a point load, of 60 x 60 functions"),
        "disc of 1 mm": ([DiscLoad(0.031, 0.052, radius=1e-3)], "a disc of 1 mm radius, 60 x 60"),
        "disc of 5 mm": ([DiscLoad(0.031, 0.052, radius=5e-3)], "a disc of 5 mm radius, 60 x 60"),
        "two loads": (
            [PointLoad(0.031, 0.052), PointLoad(0.051, 0.052)],
            "two point loads, 20 mm apart, of 60 x 60 functions",
        ),
    }
    for name, (loads, what) in resolved.items():
        yield case_of(
            name,
            f"{what}, of which those that are fitted follow 8 x 8",
            _TENS,
            (8, 8),
            true_basis=finest,
            truth=plate.deflection(
                [scaled_to(plate, each, 1e-3, finest) for each in loads], finest
            ),
            kind=CaseKind.LINEAR,
        )
    sheet = replace(plate, thickness=0.25e-3)
    load = scaled_to(sheet, PointLoad(0.031, 0.052), 0.4e-3, fine)
    yield case_of(
        "skin that stretches",
        "moved by 1.6 of its thickness and held in its plane: narrower than a plate that bends",
        _TENS,
        (8, 8),
        true_basis=fine,
        truth=Stretching(sheet, fine)(load.modal(fine).reshape(fine.shape)),
        kind=CaseKind.LINEAR,
    )
    yield case_of(
        "load on the edge",
        "the edge is held: a load there moves nothing, at any force",
        _TENS,
        (8, 8),
        truth=Plate(_SQUARE).deflection([PointLoad(0.0, 0.04, 100.0)], SineBasis(_SQUARE, 8, 8)),
    )
    yield case_of("no load", "nothing but noise", _TENS, (8, 8), truth=np.zeros((8, 8)))
    yield case_of("no load, exact", "every reading is zero: there is no scale to compare with",
                  _TENS, (8, 8), truth=np.zeros((8, 8)), noise=0)  # fmt: skip


def _only(channel: int) -> SensorLayout:
    live = np.zeros_like(_TENS.live)
    live[channel] = True
    return replace(_TENS, live=live)


def _elements() -> Iterator[HardCase]:
    for channel, name in enumerate(COMPONENTS):
        yield case_of(f"only {name}", "one component of three", _only(channel), (8, 8))
    yield case_of("dead elements", "five elements of a hundred read nothing",
                  _TENS.without([0, 11, 12, 57, 99]), (8, 8))  # fmt: skip
    yield case_of("dead row", "a row of ten elements reads nothing",
                  _TENS.without(range(40, 50)), (8, 8))  # fmt: skip
    quarter = _TENS.without(p + 10 * q for p in range(5) for q in range(5))
    yield case_of("dead quarter", "a quarter of the skin is not read", quarter, (5, 5))
    yield case_of("dead quarter, 8 x 8", "a quarter is not read, and functions are fine enough to "
                  "be limited to it", quarter, (8, 8),
                  announced="float32 has too few digits to resolve the dead quarter")  # fmt: skip
    yield case_of("all dead", "no element reads anything", _TENS.without(range(100)), (8, 8),
                  truth=np.zeros((8, 8)), announced="there is nothing to go by")  # fmt: skip
    rng = np.random.default_rng(SEED)
    points = rng.uniform(0.0, 0.1, (60, 2))
    yield case_of("scattered", "60 elements at random positions", _scattered(points), (6, 5))
    clusters = np.repeat(rng.uniform(0.01, 0.09, (6, 2)), 12, axis=0)
    clusters += rng.normal(0.0, 1e-3, clusters.shape)
    yield case_of("clustered", "72 elements in six clusters of 2 mm", _scattered(clusters), (5, 5),
                  announced="between the clusters few readings depend on the shape")  # fmt: skip
    yield case_of("nearly coincident", "40 elements, each with another 1 nm beside it",
                  _scattered(np.vstack([points[:40], points[:40] * (1 - 1e-8)])),
                  (6, 5))  # fmt: skip
    for gap in (1e-5, 1e-9, 1e-16):
        yield _pair(gap)


def _scattered(points: Array) -> SensorLayout:
    return SensorLayout.scattered(_SQUARE, points)


def _pair(gap: float) -> HardCase:
    """Two places, each with two elements, whose `gap` in m alone distinguishes two functions."""
    x = np.repeat([0.03 - gap / 2, 0.03 + gap / 2], 2)
    points = np.column_stack([x, np.full(4, 0.01)])
    return case_of(
        f"pairs {gap:.0e} m apart",
        "two functions, seen from nearly the same place: only their common part exceeds the noise",
        SensorLayout.scattered(Patch(0.1, 0.02, strip=True), points),
        (2, 1),
        announced="only the distance of the elements distinguishes the functions",
    )


def _scales() -> Iterator[HardCase]:
    for name, side in (("1 mm", 1e-3), ("1 m", 1.0)):
        yield case_of(f"{name} patch", f"the lengths of M's columns go with 1/{name}^2",
                    SensorLayout.regular(Patch(side, side), 10, 10), (8, 8),
                    kind=CaseKind.LINEAR)  # fmt: skip
    extremes = {
        1e-300: "a sequence cannot begin with readings of less than 1e-150 1/m",
        1e290: "readings beyond 1e77 1/m are refused",
    }
    for size, announced in extremes.items():
        yield case_of(
            f"readings of {size:g} 1/m",
            "squares of such numbers are zero or infinite",
            _TENS,
            (8, 8),
            truth=size * _dent(8),
            noise=0,
            kind=CaseKind.LINEAR,
            announced=announced,
        )
    yield case_of("1:100", "functions in x have ten thousand times the curvature of those in y",
                  SensorLayout.regular(Patch(0.01, 1.0), 4, 20), (3, 15))  # fmt: skip


def _readings() -> Iterator[HardCase]:
    holes = np.random.default_rng(SEED).random((_PATTERNS, 3, 100))
    holes = np.tile(holes, (FRAMES // _PATTERNS, 1, 1))

    def spiked(K: Array) -> Array:
        K.reshape(FRAMES, -1)[range(FRAMES), (37 * np.arange(FRAMES)) % 300] += 1e6
        return K

    def lost(share: float, what: float) -> Callable[[Array], Array]:
        return lambda K: np.where(holes < share, what, K)

    yield case_of("NaN", "one reading in ten is missing, others in the next frame", _TENS, (8, 8),
                  spoilt=lost(0.1, np.nan))  # fmt: skip
    yield case_of("infinity", "one reading in ten is infinite", _TENS, (8, 8),
                  spoilt=lost(0.1, np.inf))  # fmt: skip
    yield case_of("all NaN", "every reading is missing", _TENS, (8, 8), spoilt=lost(2.0, np.nan),
                  announced="there is nothing to go by")  # fmt: skip
    chain = Transduction()
    yield case_of("rails", "bent so far that the electronics saturate at the peak",
                  _TENS, (8, 8), truth=_strong(chain), noise=0.1, kind=CaseKind.LINEAR,
                  spoilt=lambda K: chain.curvature(chain.counts(K)))  # fmt: skip
    yield case_of("spikes", "one reading of each frame is off by 1e6 1/m", _TENS, (8, 8),
                  spoilt=spiked, announced="a spike is no noise: bars widen with it")  # fmt: skip
    for share in (0.1, 0.25):
        yield case_of(f"{100 * share:.0f} % of the elements bad",
                      "so many elements are off by 20 to 40 times the noise, by the same in each"
                      " channel, others in the next frame", _TENS, (8, 8),
                      spoilt=_with_offsets(share),
                      announced="an offset is no noise: too many may be told as such",
                      kind=CaseKind.OUTLIERS)  # fmt: skip
    yield case_of("sigma half the noise", "with the sigma that is given, bars would be half as "
                  "wide as they should be", _TENS, (8, 8), sigma=TABLE_1_NOISE / 2,
                  announced="the residuals contradict the sigma", kind=CaseKind.GIVEN)  # fmt: skip
    finest = SineBasis(_SQUARE, 60, 60)
    load = scaled_to(Plate(_SQUARE), PointLoad(0.031, 0.052), 1e-3, finest)
    yield case_of("drift", "all readings drift by four times the noise, evenly over the skin, "
                  "beside a point load", _TENS, (8, 8), true_basis=finest,
                  truth=Plate(_SQUARE).deflection([load], finest), spoilt=_drifted,
                  announced="the drift is estimated too", kind=CaseKind.DRIFT)  # fmt: skip
    dent = _dent(8)
    signal = _TENS.operator(SineBasis(_SQUARE, 8, 8)) @ dent.ravel()
    noise = 10 * root_mean_square(signal)
    yield case_of("noise 10 times the signal", "readings hold more noise than shape",
                  _TENS, (8, 8), truth=dent, noise=noise)  # fmt: skip


def _other_readings() -> Iterator[HardCase]:
    heights, slopes = _TENS.reading_each(["height"]), _TENS.reading_each(["slope@0"])
    yield case_of("heights", "fine functions hardly move the skin: 5 um of noise hides them",
                  heights, (8, 8), truth=_dent(8), noise=5e-6)  # fmt: skip
    yield case_of("heights, Ni > m", "at every element function 11 is function 9, and 12 is 8",
                  heights, (12, 8), truth=_dent(12)[:, :8], noise=5e-6,
                  announced="80 of 96 coefficients are determined")  # fmt: skip
    yield case_of("slopes along x", "no reading is of the slope along y", slopes, (8, 8),
                  truth=_dent(8), noise=5e-4)  # fmt: skip
    both = _TENS.reading_each(["height", "slope@0", "slope@90"])
    sigma = np.repeat([5e-6, 5e-4, 5e-4], len(_TENS))
    yield case_of("heights and slopes", "in their units slopes are a hundred times as large: "
                  "unweighted, heights would count for nothing", both, (8, 8), truth=_dent(8),
                  noise=sigma, sigma=sigma)  # fmt: skip


def _drifted(K: Array) -> Array:
    """Readings with a level and slopes along x and y of their own in each channel."""
    u, v = (_TENS.positions / (_SQUARE.a, _SQUARE.b) - 0.5).T
    drift = np.array([[1.0, 1.6, -1.2], [-0.8, 0.9, 1.5], [0.6, -1.1, 1.3]])
    drift = drift @ np.stack([np.ones_like(u), u, v])
    return K + 4 * TABLE_1_NOISE * drift / root_mean_square(drift)


def _with_offsets(share: float) -> Callable[[Array], Array]:
    def spoilt(K: Array) -> Array:
        rng = np.random.default_rng(SEED + 1)
        for frame in K:
            bad = rng.permutation(frame.shape[1])[: round(share * frame.shape[1])]
            frame[:, bad] += TABLE_1_NOISE * rng.uniform(20, 40, len(bad)) * rng.choice([-1, 1])
        return K

    return spoilt


def _strong(chain: Transduction) -> Array:
    """A dent whose peak curvature is half as much again as the electronics can measure."""
    basis = SineBasis(_SQUARE, 8, 8)
    c = Plate(_SQUARE).deflection([PointLoad(0.045, 0.045)], basis)
    peak = np.abs(_TENS.operator(basis) @ c.ravel()).max()
    low, high = chain.limits
    return c * 1.5 * 0.5 * (high - low) * chain.resolution / peak


def _slopes() -> Iterator[HardCase]:
    basis = SineBasis(_SQUARE, 8, 8)
    c = Plate(_SQUARE).deflection([PointLoad(0.04, 0.06)], basis)
    slope = np.abs(basis.on_grid(*_SQUARE.grid(101, 101), dx=1)(c)).max()
    for steepest in (0.5, 0.9, 1.4):
        truth = c * steepest / slope
        skin = FiniteSlopeLeastSquares(basis, _TENS)
        rng = np.random.default_rng(SEED)
        K = skin.predicted(truth) + rng.normal(0.0, TABLE_1_NOISE, (FRAMES, 3, 100))
        hard = "gages sense the curvature of the bent surface, which is not that of Eqs. 3-5"
        yield HardCase(f"slopes of {steepest}", hard, basis, _TENS, basis, truth, K,
                       "linear methods neglect slopes", CaseKind.SLOPES)  # fmt: skip


def _sequence(frames: int, elements: int, functions: int) -> HardCase:
    """A dent that goes round a hundred times."""
    layout = SensorLayout.regular(_SQUARE, elements, elements)
    basis = SineBasis(_SQUARE, functions, functions)
    turn = 2 * np.pi * np.arange(400) / 400
    places = 0.05 + 0.02 * np.column_stack([np.cos(turn), np.sin(turn)])
    way = Plate(_SQUARE).compliance(basis).values * basis.at(places)
    way *= 1e-3 / np.abs(way).max()
    truth = way[np.arange(frames) % len(way)].reshape(frames, *basis.shape)
    return case_of(f"{frames} frames", "errors of many steps could add up, and a covariance lose "
                   "its definiteness", layout, basis.shape, truth=truth,
                   kind=CaseKind.SEQUENCE)  # fmt: skip


def _large(count: int) -> HardCase:
    """`count` functions a side on one more element a side."""
    patch = Patch(0.1, 0.1)
    basis, layout = (
        SineBasis(patch, count, count),
        SensorLayout.regular(patch, count + 1, count + 1),
    )
    rng = np.random.default_rng(SEED)
    c = 0.3 / count * rng.normal(size=basis.shape) / basis.laplacian
    x, y = patch.cell_centres(count + 1, count + 1)
    clean = np.stack([CurvatureMap(basis, name, x, y)(c).ravel() for name in COMPONENTS])
    K = clean + rng.normal(0.0, TABLE_1_NOISE, (FRAMES, *clean.shape))
    return HardCase(f"{count} x {count}", f"{count**2} unknowns of {clean.size} readings", basis,
                layout, basis, c, K, kind=CaseKind.LARGE)  # fmt: skip


def gallery(long: bool = False) -> Iterator[HardCase]:
    """Every case, made on demand; the largest only when `long`."""
    rooms = _sizes, _arcs, _domes, _loads, _elements, _scales, _readings, _other_readings, _slopes
    for room in rooms:
        yield from room()
    yield _sequence(1000, 6, 4)
    yield _large(64)
    if long:
        yield _sequence(1_000_000, 4, 3)
        for count in (128, 256, 512):
            yield _large(count)
