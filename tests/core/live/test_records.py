"""Estimates as few bytes."""

import zlib

import numpy as np
import pytest

from kappaskin import Pipeline, Simulator, load_scene
from kappaskin.live.codec import BadMessageError
from kappaskin.live.records import packed, unpacked
from kappaskin.live.ring import Ring, slot_type
from kappaskin.pipeline import usual_setup


def record_of(name: str):
    scene = load_scene(name)
    pipeline = Pipeline(scene.sensor(), usual_setup(scene.sensor()))
    slot, ring = slot_type(pipeline), Ring.create()
    try:
        ring.lay_out(1, slot)
        ring.write(pipeline(Simulator(scene).frame(100, lambda: 0.0)))
        found = ring.newest(1, slot)
        assert found is not None
        return found[1]
    finally:
        ring.destroy()


@pytest.mark.cases("circle")
@pytest.mark.parametrize("name", ["circle", "thumb-pad", "fingertip-cap", "camera"])
def test_numbers_are_exact_and_arrays_nearly(name: str) -> None:
    record = record_of(name)
    data = packed(record)
    found = unpacked(data, record.dtype)
    assert len(data) < record.dtype.itemsize / 4
    for field in record.dtype.names:
        given, got = record[field], found[field]
        if given.dtype.kind != "f" or given.size <= 16:
            assert given.tobytes() == got.tobytes(), field
        elif "surface" in field:
            np.testing.assert_allclose(
                got, given, rtol=0, atol=np.nanmax(np.abs([given, got])) / 6e4
            )
        else:
            np.testing.assert_allclose(got, given, rtol=6e-8, atol=1e-38)


def test_a_surface_without_anything_is_nothing() -> None:
    record = record_of("circle")
    record["surface"], record["true_surface"] = 0.0, np.nan
    found = unpacked(packed(record), record.dtype)
    assert (found["surface"] == 0).all()
    assert np.isnan(found["true_surface"]).all()


@pytest.mark.parametrize(
    "change", [lambda d: d[:-8], lambda d: b"", lambda d: zlib.compress(bytes(10**6))]
)
def test_other_bytes_are_refused(change) -> None:
    record = record_of("circle")
    with pytest.raises(BadMessageError):
        unpacked(change(packed(record)), record.dtype)
