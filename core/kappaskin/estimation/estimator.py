"""The interface of all estimators: readings to coefficients with error bars."""

import math
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable
from functools import cached_property
from typing import ClassVar, Generic, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis, ValueMap, covariant_maps, curvature_at
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation.fit import Fit, Uncertainty
from kappaskin.frames import Array, Mask
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, MeshSkin

_SETS = 8  # that are cached: those used last
_Made = TypeVar("_Made")


class PatternCache(Generic[_Made]):
    """A cache of results that depend on which readings there are, for the last few such sets."""

    def __init__(self) -> None:
        self._made: OrderedDict[bytes, _Made] = OrderedDict()

    def __call__(self, used: Mask, make: Callable[[Mask], _Made]) -> _Made:
        """`make(used)` for the mask `used` of readings, from the cache where it is there."""
        key = used.tobytes()
        if key in self._made:
            self._made.move_to_end(key)
            return self._made[key]
        made = self._made[key] = make(used)
        if len(self._made) > _SETS:
            self._made.popitem(last=False)
        return made


# Powers of the largest number: the squares of readings over sigmas, added up, stay below it.
_SAFE, _SAFE_SIGMA = 0.25, 0.2
_WIDEST = 1e60  # m: squares of what it makes of any derivative of the displacement are numbers
_FINEST = 65  # points along a side at most where slopes are computed
_NAMED = 2**18  # readings times functions: of more, none that is not determined is named
_NEARLY = 1e-6  # of the largest part: as large
_UNSEEN = 1e-15  # of the longest column: a function whose curvature cancels, as on half a circle


def real_array(values: ArrayLike, what: str, dtype: DTypeLike = np.float64) -> Array:
    """A copy of `values` in this `dtype`; raises a `Refusal` for anything but real numbers."""
    if type(values) is np.ndarray and values.dtype == dtype:  # as in most frames: the fastest
        return values.copy()
    try:
        given = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        raise Refusal(f"expected {what} as an array of real numbers, got {error}") from error
    # A masked array would lose its mask.
    if given.dtype.kind not in "biuf" or hasattr(values, "filled"):
        raise Refusal(
            f"expected {what} as an array of real numbers, NaN where one is missing; got "
            f"{type(values).__name__} of {given.dtype}"
        )
    with np.errstate(over="ignore"):  # to infinity, in float32
        return given.astype(dtype)


def column_lengths(A: Array) -> Array:
    """Lengths (F,) of the columns of A (R, F); infinite where only rounding is left."""
    length = np.linalg.norm(A, axis=0)
    length[length <= _UNSEEN * length.max(initial=0.0)] = np.inf
    return length


class Estimator(ABC):
    """`fit = LeastSquares(basis, layout)`, factored once; `fit(readings)` is a `Fit`.

    A frame has the shape (3, P) and the unit 1/m, as below, where a curvature sensor reads; other
    readings are (R,) in units of their own. `sigma`, a scalar or (3, P), is the standard deviation
    of each reading; without it all weigh the same and their noise is estimated. An infinite sigma
    excludes a reading. `rim_sd` in m is the standard deviation of each unobservable movement of an
    elastic rim, by RMS along it; readings of height or slope determine these, and it is not used.
    Frames are computed in `dtype`, float64 or float32; the factorisation is always in float64.
    """

    RIM_SD: ClassVar = 0.2e-3
    """Default standard deviation in m of the movement of an elastic rim."""
    linear: ClassVar = True
    """Whether it takes the readings for those of slight slopes."""
    has_matrix: ClassVar = True
    """Whether it uses the layout's operator M as a matrix, R x Ni Nj numbers."""
    has_prior: ClassVar = False
    """Whether a prior decides what the readings do not, so that no basis is too large."""
    has_memory: ClassVar = False
    """Whether a fit depends on earlier frames: `follow` each frame once, in order."""

    has_rim: ClassVar = True
    """Whether it can estimate how an elastic rim moves, where the readings tell."""
    has_datum: ClassVar = False
    """Whether it can estimate the offset of readings whose zero is unknown."""

    failure: ClassVar = "no convergence{}; least squares shown"
    """Why a fit has not converged, and what to do, in words; {} is for the frames."""

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        sigma: ArrayLike | None = None,
        rim_sd: float = RIM_SD,
        dtype: DTypeLike = np.float64,
    ) -> None:
        if not 0 <= rim_sd <= _WIDEST:
            raise Refusal(
                f"expected a rim_sd of at least zero and at most {_WIDEST:g} in m, got {rim_sd}"
            )
        if np.dtype(dtype).name not in ("float64", "float32"):
            raise Refusal(f"expected float64 or float32 to compute in, got {np.dtype(dtype)}")
        self.basis, self.layout, self.rim_sd = basis, layout, rim_sd
        # Typed as float64: what holds for one holds for the other.
        self.dtype = cast("np.dtype[np.float64]", np.dtype(dtype))
        self.combinations, unobservable = combinations(basis, layout)
        """The combinations (N, F) of functions that are fitted; None for all of them."""
        self.undecided = rim_sd * unobservable
        """Unobservable shapes (N, q) in m, each one standard deviation large."""
        numbers = np.finfo(self.dtype)
        self._largest, self._faint = float(numbers.max) ** _SAFE, float(numbers.tiny)
        self._faintest = float(numbers.tiny / numbers.eps)
        self.frame_shape = layout.frame_shape
        """The shape of the readings of a frame, (3, P) or (R,)."""
        self._check_readings(sigma is not None)
        self.sigma = None if sigma is None else real_array(sigma, "sigma")
        """The given standard deviations in 1/m, one or (3, P); None if none were given."""
        self.weight = self._weights(1.0 if self.sigma is None else self.sigma)
        """Weight 1 / sigma (R,) of each reading in m; 1 without a sigma."""
        self.readable: Mask = layout.live.ravel() & (self.weight > 0)
        """Which readings (R,) are used when they are present."""
        self._all_readable = bool(self.readable.all())
        self.unknowns: int = basis.size if self.combinations is None else self.combinations.shape[1]
        """Number of unknowns: the coefficients minus those fixed by the boundary conditions."""
        self._set_up()

    @abstractmethod
    def _set_up(self) -> None:
        """Compute once what no frame changes; raises a `Refusal` when no shape is determined."""

    def restart(self) -> None:
        """Forget every frame, where there is a memory."""
        return

    def _check_readings(self, sigma_known: bool) -> None:
        """Raise a `Refusal` for readings that this estimator cannot take."""
        basis, layout, name = self.basis, self.layout, type(self).__name__
        if layout.offsets.size and not self.has_datum:
            raise Refusal(
                f"expected readings of a known zero for {name}, got a free datum of "
                f"{' and '.join(layout.reads.free if layout.reads else ())}; use least-squares or "
                "bayes"
            )
        if not self.has_rim and basis.unobservable is not None and not layout.senses_curvature_only:
            raise Refusal(
                f"expected readings of curvature alone for {name} on an elastic rim, got readings "
                f"in {layout.units}, which move with the rim; use least-squares"
            )
        if not sigma_known and " or " in layout.units:
            raise Refusal(
                f"expected the sigma of readings that differ in unit, {layout.units}, got none; "
                "give each its standard deviation"
            )

    def _weights(self, sigma: float | Array) -> Array:
        sigma = np.asarray(sigma)
        if sigma.shape not in ((), self.frame_shape):
            raise Refusal(
                f"expected sigma to be one number or {self.frame_shape}, got {sigma.shape}"
            )
        if not np.all(sigma > 0):
            raise Refusal(
                f"expected every sigma above zero in {self.layout.units}, got zero, less or NaN"
            )
        known, most = sigma[sigma < np.inf], float(np.finfo(self.dtype).max) ** _SAFE_SIGMA
        if np.any((known > most) | (known < 1 / most)):
            raise Refusal(
                f"expected every sigma from {1 / most:.1g} to {most:.1g} {self.layout.units}, or "
                f"infinite, in {self.dtype}, got {known.min():g} to {known.max():g}"
            )
        return np.broadcast_to(1 / sigma, self.frame_shape).reshape(-1)

    @cached_property
    def M(self) -> Array:
        """The layout's operator (R, Ni Nj) (Eq. 2)."""
        return self.layout.operator(self.basis)

    @cached_property
    def _M_T(self) -> Array:
        return self.M.T.astype(self.dtype)

    def predicted(self, coefficients: Array) -> Array:
        """Readings (..., 3, P) in 1/m that `coefficients` (..., Ni, Nj) in m would cause."""
        frames = coefficients.shape[:-2]
        flat = coefficients.reshape(*frames, self.basis.size)
        return np.dot(flat, self._M_T).reshape(*frames, *self.frame_shape)

    def flattened(self, readings: Array) -> Array:
        """Readings (..., 3, P) of one frame or several as (..., R)."""
        frames = readings.shape[: readings.ndim - len(self.frame_shape)]
        return readings.reshape(*frames, self.layout.channels)

    @cached_property
    def _slopes(self) -> list[list[tuple[float, ValueMap]]]:
        """The slopes along x and along y as sums of terms, on a grid that shows the finest."""
        patch, (Ni, Nj) = self.basis.patch, self.basis.shape
        at = patch.grid(*(min(4 * count + 1, _FINEST) for count in (Ni, Nj)))
        if isinstance(patch, Cap | MeshSkin):
            return [[(1.0, values)] for values in covariant_maps(self.basis, *at)[1:3]]
        terms = [[(1.0, (1, 0))], [(1.0, (0, 1))]]
        if H := patch.arc_curvature:
            terms[0].append((H**2, (-1, 0)))
        return [[(h, self.basis.on_grid(*at, *order)) for h, order in each] for each in terms]

    def slope(self, coefficients: Array) -> float:
        """The largest slope on the skin of the shape with `coefficients` (Ni, Nj); 0 of NaN.

        On a bent skin p = f_x + H v along the arc, with v_x = H f, as the tangent turns.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # infinitely steep
            x, y = (sum(h * values(coefficients) for h, values in each) for each in self._slopes)
            squares = np.square(x) + np.square(y)
            return math.sqrt(np.max(squares, initial=0.0, where=squares >= 0))

    def _of_one_frame(self, K: Array) -> bool:
        """Whether K is one frame, not T of them; raises a `Refusal` for any other shape."""
        shape, one = K.shape, self.frame_shape
        if shape == one:
            return True
        if shape[1:] == one:
            return False
        raise Refusal(
            f"expected readings of shape {one} or (T, {', '.join(map(str, one))}), got {shape}"
        )

    def __call__(self, readings: ArrayLike) -> Fit:
        """Fit `readings` (3, P) or (T, 3, P) in 1/m; NaN and infinity mean a missing reading.

        So do single readings too large to compute with: 4e9 in float32, 1e77 in float64; a frame
        without any above 1e-31 in float32, 1e-292 in float64, is of zeros. Raises
        `RankDeficient` when the readings do not determine the shape, or are so large throughout.
        """
        # A copy: residuals are computed from it later.
        K = real_array(readings, "readings", self.dtype)
        alone = self._of_one_frame(K)
        flat = K.reshape(-1) if alone else self.flattened(K)
        squares = _squares(flat)
        if not _all(squares >= self._faint):  # NaN too
            self._flush(flat)
        if self._all_readable and _all(squares <= self._largest**2):
            return self._fit(flat, self.readable)
        used = self._there(flat)
        flat[~used] = np.nan
        if np.all(used == self.readable):
            return self._fit(flat, self.readable)
        if alone:
            return self._fit(flat, used)
        patterns, which = np.unique(used, axis=0, return_inverse=True)
        which = which.ravel()
        fits: list[Fit] = []
        for number, pattern in enumerate(patterns):
            try:
                fits.append(self._fit(flat[which == number], pattern))
            except RankDeficient as error:
                first = int(np.argmax(which == number))
                # An estimator inside this one counts the frames that it was given.
                inner = error.__cause__
                why = inner if isinstance(inner, RankDeficient) else error
                raise RankDeficient(f"frame {first}: {why}") from why
        return Fit.merged(fits, np.argsort(np.argsort(which, kind="stable")))

    def _there(self, flat: Array) -> Mask:
        """Which readings (..., R) are used; those missing or too large to compute with are not.

        Raises `RankDeficient` where they are too large throughout: the small ones are no shape.
        """
        size = np.abs(flat)
        small = size <= self._largest
        beyond = np.isfinite(size) & ~small
        if beyond.any():
            kept = np.max(size, axis=-1, initial=0.0, where=small)
            throughout = (kept > math.sqrt(self._largest)) | ~small.any(axis=-1)
            if np.any(throughout & beyond.any(axis=-1)):
                raise RankDeficient(
                    f"expected readings of at most {self._largest:.1g} {self.layout.units} in "
                    f"{self.dtype}, and NaN for missing ones; got {size[beyond].max():.3g}; check "
                    "their unit"
                )
        return small & self.readable

    def _flush(self, flat: Array) -> None:
        """Set readings (..., R) to zero where they are so small throughout that digits are lost.

        Their coefficients, some thousand times smaller, would have next to none.
        """
        largest = np.max(np.abs(flat), axis=-1, initial=0.0, where=np.isfinite(flat), keepdims=True)
        flat[(largest < self._faintest) & np.isfinite(flat)] = 0.0

    def follow(self, readings: Array, times: Array, held: Array) -> Fit:
        """Fit the next frame: `readings` (3, P) in 1/m read at `times` (3, P) in s.

        Both are NaN where nothing was read; `held` (3, P) also has the readings held from earlier
        frames. An estimator without memory fits `held`.
        """
        return self(held)

    def at_rest(self, missing: Mask | None = None) -> Fit:
        """The fit to a skin at rest, without the readings `missing` (3, P)."""
        return self(self._rest(missing))

    def scatter(self, noise: float, readings: Array | None = None) -> Uncertainty:
        """How estimates of repeated readings of one load differ, per unit of their noise.

        `noise` in 1/m, in units of sigma where that was given; `readings` (3, P) in 1/m are those
        of the load without noise, of a skin at rest when None.
        """
        fit = self.at_rest() if readings is None else self(readings)
        return cast("Uncertainty", fit.uncertainty)

    def _rest(self, missing: Mask | None) -> Array:
        rest = np.zeros(self.frame_shape)
        return rest if missing is None else np.where(missing, np.nan, rest)

    @abstractmethod
    def _fit(self, flat: Array, used: Mask) -> Fit:
        """Fit readings (R,) or (T, R), of which those `used` (R,) are there, the rest NaN."""

    def _answer(
        self, flat: Array, c: Array, spread: Uncertainty, spare: int, steps: ArrayLike = 0
    ) -> Fit:
        """The fit of `c` (..., N) or (..., Ni, Nj) to `flat` (..., R), all of one `spread`."""
        frames = flat.shape[:-1]
        return Fit(
            self,
            flat.reshape(*frames, *self.frame_shape),
            c.reshape(*frames, *self.basis.shape),
            [spread] * frames[0] if frames else spread,
            spare,
            None if self.sigma is None else np.ones(frames),
            steps,
        )

    def _moves_as_a_whole(self) -> bool:
        """Whether a function of the basis changes no curvature anywhere; only arcs may have one."""
        patch, W = self.basis.patch, self.basis.free
        if not (patch.strip and patch.arc_curvature):
            return False
        x, y = patch.cell_centres(2 * self.basis.size + 1, 1)
        bends = curvature_at(self.basis, np.column_stack([x, np.repeat(y, len(x))]))[0]
        return bool(np.isinf(column_lengths(bends if W is None else bends @ W)).any())

    def _columns(self, used: Mask) -> Array:
        """The weighted operator (r, F) of the readings `used` on the unknowns."""
        W = self.combinations
        return self.weight[used, None] * (self.M[used] if W is None else self.M[used] @ W)

    def _unobserved(self, used: Mask) -> str:
        """A function that the readings `used` do not determine, in words; nothing of many."""
        if np.count_nonzero(used) * self.basis.size > _NAMED:
            return ""
        return unobserved_function(self.basis, self.layout, self.M, used)

    def refusal(self, readings: int, rank: int, used: Mask | None = None) -> RankDeficient:
        """The error for `readings` readings that determine only `rank` coefficients.

        Of those `used` (R,) it names a function that they do not determine.
        """
        (Ni, Nj), N, layout = self.basis.shape, self.unknowns, self.layout
        bound = "at most " if readings < N else ""
        what = f"{layout} with {readings} readings determine {bound}{rank} of the {N} coefficients "
        what += f"of a {Ni} x {Nj} basis"
        if d := layout.offsets.shape[1]:
            what += f", {d} of them for the unknown zero"
        if readings == 0:
            return RankDeficient(
                f"{what}: no readings are left; check the connection and the dead elements"
            )
        unobserved = "" if used is None else self._unobserved(used)
        channels = int(np.count_nonzero(layout.live | layout.lacking))
        missing = channels - readings
        if not layout.reads and self._moves_as_a_whole():
            return RankDeficient(
                f"{what}: one function is a rigid motion without curvature; hold the "
                "edges so that it is not possible (pin the ends of the arc)"
            )
        if layout.shape and not missing and not layout.reads:
            m, n = layout.shape
            # Along each direction, mode m + q equals m - q at the cell centres.
            return RankDeficient(
                f"{what}: functions finer than the elements have the readings of coarser ones; "
                f"use at most {min(Ni, m)} x {min(Nj, n)} functions, or more elements, or a prior "
                f"(bayes){unobserved}"
            )
        why = (
            f"{missing} of {channels} readings are missing"
            if missing
            else ("the elements cannot distinguish these functions")
        )
        return RankDeficient(
            f"{what}: {why}; use a smaller basis (at most {rank} functions), more elements, or a "
            f"prior (bayes){unobserved}"
        )


def unobserved_function(basis: Basis, layout: SensorLayout, M: Array, used: Mask) -> str:
    """The function of the largest part in what the readings `used` (R,) leave open, in words.

    M (R, N) is the operator of the layout. Nothing where there is no such function.
    """
    W = combinations(basis, layout)[0]
    A = np.hstack([M[used] if W is None else M[used] @ W, layout.offsets[used]])
    s, Vt = np.linalg.svd(A / column_lengths(A))[1:]
    open_ = Vt[int(np.sum(s > s[:1] * max(A.shape) * np.finfo(float).eps)) :]
    shapes = open_[:, : A.shape[1] - layout.offsets.shape[1]]
    parts = np.linalg.norm(shapes if W is None else shapes @ W.T, axis=0)
    if not parts.any():
        return ""
    # Of functions with the same readings the finest is one too many.
    largest = int(np.flatnonzero(parts >= (1 - _NEARLY) * parts.max())[-1])
    i, j = divmod(largest, basis.shape[1])
    return f"; no reading determines function {i + 1} x {j + 1}"


def combinations(basis: Basis, layout: SensorLayout) -> tuple[Array | None, Array]:
    """The combinations (N, F) that readings may determine, and those (N, q) that none does.

    What has no curvature has heights and slopes.
    """
    free, still = basis.free, basis.unobservable
    if still is None:
        return free, np.empty((basis.size, 0))
    if layout.senses_curvature_only:
        return free, still
    return np.hstack([np.eye(basis.size) if free is None else free, still]), still[:, :0]


def _all(each: Mask) -> bool:
    return bool(each.all() if each.ndim else each)  # of one frame far quicker


@np.errstate(over="ignore")
def _squares(flat: Array) -> Array:
    """Sums of squares (...) of `flat` (..., R): the fastest test of whether it is finite."""
    return np.vecdot(flat, flat)
