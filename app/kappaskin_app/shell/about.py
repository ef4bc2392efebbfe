"""What each panel and each dock is for, with the equation where there is one, and where more is."""

from collections.abc import Mapping

PANELS: Mapping[str, str] = {
    "Connection": (
        "Where readings come from: the simulated skin, a serial port, any address that pyserial "
        "opens, or a recording. A line that breaks is taken up again by itself; what was missed "
        "meanwhile is counted."
    ),
    "Recording": (
        "Writes all that comes in, before anything is made of it, to a file that outlives a crash; "
        "plays such a file again, with other settings if you like."
    ),
    "Tare": (
        "Takes the mean of what every element reads now for its zero: \u03ba = reading \u2212 "
        "zero. The skin must be at rest and free, or a contact that is held would vanish."
    ),
    "Load": (
        "What presses on the simulated skin, where and how hard. Drag the red arrow on the skin, "
        "or type numbers here."
    ),
    "Noise": (
        "What is added to every simulated reading: independent, of mean zero and of this RMS. "
        "With a seed the same noise comes back."
    ),
    "Basis": (
        "The functions that the shape is made of, w(x, y) = \u03a3 c\u1d62\u2c7c "
        "\u03c6\u1d62\u2c7c(x, y), and how their coefficients c are found from the curvatures read."
    ),
    "To be built": (
        "A sensor that is not built yet. How sure it would be follows at once from the covariance "
        "s\u00b2 (M\u1d40M)\u207b\u00b9 of noise s and the fit's matrix M; nothing is simulated."
    ),
    "View": "How the skin is drawn: its colours, its height and what is drawn over it.",
    "Publish": (
        "Sends the contact with its error bars to other programs, as JSON by UDP or to Foxglove; "
        "receivers of twenty lines come with the library."
    ),
    "Shape": (
        "The simulated skin at rest, flat or bent, and how its edge is held. What a flat one does "
        "under a load follows from "
        "D \u2207\u2074w = p, D = E h\u00b3 / (12 (1 \u2212 \u03bd\u00b2))."
    ),
    "Elements": (
        "How many sense, on a regular grid. Each reads three curvatures where it is: xx = "
        "\u2202\u00b2w/\u2202x\u00b2, yy = \u2202\u00b2w/\u2202y\u00b2, "
        "xy = \u2202\u00b2w/\u2202x\u2202y of a flat skin's displacement w."
    ),
    "Below and around": (
        "What carries the simulated skin beside its stiffness: tension T, foam k, a fluid that "
        "keeps its volume. D \u2207\u2074w \u2212 T \u2207\u00b2w + k w = p."
    ),
    "Electronics": (
        "What turns the change of resistance of a gage into counts, with how many bits and how "
        "fast: a step of the converter and its noise are the least that can be told apart."
    ),
    "Gages": (
        "What spoils the reading of a real gage: loops (it comes back another way), creep, and "
        "gages that are not alike."
    ),
    "Region of interest": (
        "Scans only part of the channels in each frame, around the contact or those chosen: "
        "frames/s = 1 / (channels \u00d7 conversion time)."
    ),
    "In use": (
        "The calibration that turns readings into curvatures now, if there is one, and how well it "
        "fits this sensor."
    ),
    "Cylinders of known radius": (
        "Lays the skin on cylinders one after the other: there \u03ba = 1 / R, so that each "
        "channel's gain and offset follow."
    ),
    "B": "Other settings for the same readings, to hold against those in use (A).",
}

PAGES: Mapping[str, str] = {
    **dict.fromkeys(("Connection", "Tare"), "connect"),
    **dict.fromkeys(("Recording", "Publish"), "record"),
    **dict.fromkeys(("Load", "Noise", "Shape", "Elements", "Below and around"), "scenes"),
    **dict.fromkeys(("Electronics", "Gages"), "scenes"),
    **dict.fromkeys(("Basis", "Region of interest", "B"), "accuracy"),
    **dict.fromkeys(("In use", "Cylinders of known radius"), "calibrate"),
    "View": "numbers",
    "To be built": "build",
}
"""The page of the guide that tells more than a panel does."""

DOCKS: Mapping[str, str] = {
    "settings": "What a person chooses: connection, load, basis, view, skin, sensor, calibration",
    "lesson": "Lessons of ten to fifteen minutes, from what a gage feels to mending a sensor",
    "curvature": "What each element reads, map by map: curvature xx, yy, xy or what View says",
    "cost": "What each method and setting takes and how far it errs; a click on a point takes it",
    "stability": "Which shapes the elements see well, by singular values, and the hard cases",
    "scene": "Ready scenes, the text of the one that plays, and which effects it calls for",
    "health": "Which channels are dead, stuck, noisy, swapped or drifting, and what that costs",
    "numbers": "What the picture shows as tables: contact, object, every element; copied as CSV",
    "compare": "Two settings on the same readings: both surfaces, and B less A",
    "design": "A sensor before it is built: how sure it would be, where its elements tell most",
    "element": "All about the element clicked: its last seconds, spectrum, calibration and health",
    "traces": "The last seconds of the elements chosen, in one plot each for xx, yy and xy",
    "guide": "How to begin, connect, calibrate and record, what every number means, what to mend",
    "log": "What was logged or said in passing since the window opened, newest first",
}
