"""Pipelines that are built in the background, for sensors that allow fewer functions than asked."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest

from kappaskin import Setup, load_scene
from kappaskin.calibration import Tare
from kappaskin.calibration.calibration import fingerprint
from kappaskin.live.pipelines import PipelineHost, PipelineStatus
from kappaskin.sensing import SensorLayout


@pytest.fixture
def host():
    with ThreadPoolExecutor(2) as builder:
        ring = SimpleNamespace(lay_out=lambda generation, slot: None)
        made = PipelineHost(ring, builder, PipelineStatus())
        scene = load_scene("centre")
        small = replace(scene, layout=SensorLayout.regular(scene.plate.patch, 3, 3))
        made.connect(small.sensor())
        built(made)
        yield made


def built(host):
    end = time.monotonic() + 20
    while host.status.computing and time.monotonic() < end:
        host.swap()
        time.sleep(0.005)


def tare_of(host):
    sensor = host.pipeline.sensor
    offset, now = np.ones(sensor.channels), datetime.now(UTC)
    known = sensor.name, sensor.serial_number, fingerprint(sensor.layout)
    return Tare(*known, now, None, 9, 1.0, offset, 0.1 * offset)


def test_a_sensor_of_few_elements_is_tared(host) -> None:
    fewer, refusal = host.status.setup.Ni, host.status.refusal
    assert fewer < Setup().Ni
    assert refusal
    host.request(Setup(tare=(tare := tare_of(host))))
    built(host)

    assert host.status.setup.tare is tare
    assert (host.status.setup.Ni, host.status.refusal) == (fewer, refusal)
    host.request(Setup())
    host.request(Setup(hold=0.2))  # overtakes it
    built(host)
    assert (host.status.setup.tare, host.status.setup.hold) == (None, 0.2)


def test_more_functions_than_it_allows_are_refused_where_they_are_asked_for(host) -> None:
    fewer = host.status.setup.Ni
    host.request(Setup(Ni=9, Nj=9, hold=0.2))
    built(host)

    assert (host.status.setup.Ni, host.status.setup.hold) == (fewer, 0.1)
    assert "9 x 9" in host.status.refusal
