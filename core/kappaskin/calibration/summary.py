"""What a calibration is worth, in lines for a person."""

import numpy as np

from kappaskin.calibration.report import CalibrationReport
from kappaskin.frames import COMPONENTS, Array

_WORST = 5  # channels that are named


def summary(report: CalibrationReport) -> list[str]:
    """What a person wants to know of a calibration, line by line."""
    calibration, P = report.calibration, len(report.noise) // 3

    def spread(values: Array) -> str:
        return f"{values.min():.3g} to {values.max():.3g}"

    lines = [
        f"{calibration.name} {calibration.serial_number}: {int(report.passed.sum())} of "
        f"{int(report.passed.sum()) + len(report.failed)} channels passed; curvature in 1/m",
        f"{'':<11}{'gain':<18}{'offset':<18}{'widest loop (left)':<22}error (of a line alone)",
    ]
    for c, name in enumerate(COMPONENTS):
        here = np.flatnonzero(report.passed[c * P : (c + 1) * P]) + c * P
        if here.size:
            loops = report.gaps[:, here].max(), report.gaps_left[:, here].max()
            errors = report.fitted.left_out[here].max(), report.line.left_out[here].max()
            lines.append(
                f"{name:<11}{spread(report.fitted.gain[here]):<18}"
                f"{spread(report.fitted.offset[here]):<18}"
                f"{'{:.2f} ({:.2f})'.format(*loops):<22}{errors[0]:.3f} ({errors[1]:.2f})"
            )
    if calibration.creep:
        share = float(np.median(calibration.creep.share[report.passed]))
        lines.append(f"creep      {100 * share:.1f} % in {calibration.creep.time_constant:.3g} s")
    worst = np.argsort(np.where(report.passed, -report.fitted.left_out, 0.0))[:_WORST]
    told = (f"{_named(c, P)} {report.fitted.left_out[c]:.3f}" for c in worst)
    lines.append(f"worst      {', '.join(told)}")
    return lines + [f"failed     {_named(c, P)}: {why}" for c, why in report.failed.items()]


def _named(channel: int, elements: int) -> str:
    return f"{COMPONENTS[channel // elements]} of element {channel % elements}"
