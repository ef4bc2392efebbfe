"""What a frame that scans a part of the skin costs, against a whole one."""

import time
from dataclasses import replace

import numpy as np

from kappaskin import Pipeline, Region, Setup, Simulator, load_scene
from kappaskin.contact import ForceTorqueSensor, IntrinsicContact
from kappaskin.estimation import Scanner
from kappaskin.pipeline.pipeline import FrameAssembly
from kappaskin.sensing import SECOND_GENERATION

SCENE = replace(load_scene("centre"), transduction=SECOND_GENERATION, rate=160.0)
SENSOR = SCENE.sensor()


def test_holding_what_was_left_out_adds_less_than_20_us_to_300_channels(
    medians, figure, ratio
) -> None:
    simulator, pipeline = Simulator(SCENE), Pipeline(SENSOR, Setup())
    scanner = Scanner(SENSOR, Region("skin", radius=0.025))
    scanner.follow(np.array([0.05, 0.05]))
    whole = simulator.frame(0, time.monotonic)
    part = simulator.scanned(scanner(), 1, 1e-3, time.monotonic)
    hold, readings = FrameAssembly(300, 0.1), pipeline.curvature(part)
    hold(whole, pipeline.curvature(whole))

    holding, of_part, of_whole = medians(
        lambda: hold(part, readings), lambda: pipeline(part), lambda: pipeline(whole)
    )

    figure(
        f"holding adds {holding * 1e6:.1f} us to a frame of {len(part.channels)} of 300 channels; "
        f"its estimate takes {of_part / of_whole:.2f} of that of all ({of_whole * 1e6:.0f} us)"
    )
    ratio("holding a frame's readings, of the 20 us allowed", holding / 20e-6, at_most=1)
    ratio("estimate of a part of the skin, against all of it", of_part / of_whole, at_most=1.2)


def test_a_new_set_of_missing_readings_costs_what_holding_spares(medians, figure, ratio) -> None:
    simulator, pipeline = Simulator(SCENE), Pipeline(SENSOR, Setup(hold=0))
    whole, rng = simulator.frame(0, time.monotonic), np.random.default_rng(0)

    def missing(count: int) -> None:
        channels = np.sort(rng.permutation(300)[: 300 - count])
        pipeline(replace(whole, channels=channels, counts=whole.counts[channels]))

    counts = (30, 100, 200)
    all_there, *taken = medians(
        lambda: pipeline(whole), *(lambda n=n: missing(n) for n in counts), turns=8, calls=5
    )

    figure(
        "a frame with another set of readings missing each time, in times of a whole one "
        f"({all_there * 1e6:.0f} us): "
        + ", ".join(f"{n} missing {t / all_there:.0f}" for n, t in zip(counts, taken, strict=True))
    )
    ratio("a new set of missing readings, of the 100 ms allowed", max(taken) / 0.1, at_most=1)


def test_choosing_the_next_scan_costs_little_beside_the_estimate(medians, figure, ratio) -> None:
    scanner, pipeline = Scanner(SENSOR, Region("skin")), Pipeline(SENSOR, Setup())
    whole, patch = Simulator(SCENE).frame(0, time.monotonic), SCENE.plate.patch
    base = ForceTorqueSensor((0.05, 0.05, -0.02))
    find = IntrinsicContact(patch, base)
    wrench = base.read(patch, SCENE.loads, np.random.default_rng(0))
    here = np.array([0.05, 0.05])

    def steered() -> None:
        scanner.follow(here)
        scanner()

    steering, telling, estimate = medians(steered, lambda: find(wrench), lambda: pipeline(whole))

    figure(
        f"the next scan {steering * 1e6:.0f} us, the contact from the base {telling * 1e6:.0f} us, "
        f"beside {estimate * 1e6:.0f} us for the estimate"
    )
    ratio(
        "the next scan and the contact from the base, against an estimate",
        (steering + telling) / estimate,
        at_most=1,
    )
