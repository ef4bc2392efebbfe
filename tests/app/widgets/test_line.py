"""A line of text that may do without its head."""

from kappaskin_app.widgets.line import Line


def test_where_room_is_short_the_head_is_left_out_first(qtbot) -> None:
    line = Line()
    qtbot.addWidget(line)
    line.show_text("peak 12.5 1/m", "peak ")
    width = line.fontMetrics().horizontalAdvance

    shown = []
    for room in ("peak 12.5 1/m", "12.5 1/m", "12.5"):
        line.resize(width(room) + 2, 20)
        shown.append((line.shown, line.whole))

    assert shown == [("peak 12.5 1/m", True), ("12.5 1/m", True), ("12.5 1/m", False)]
    assert line.tip().startswith("peak 12.5 1/m")
    line.show_text("short")
    line.resize(width("short") + 2, 20)
    assert line.shown == "short"
