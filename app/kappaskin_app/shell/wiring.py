"""Joins the rooms of a window: whose signal is heard by whom."""

from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt

from kappaskin_app.features.guide.pages import page_called
from kappaskin_app.guard import guarded
from kappaskin_app.shell.resume import Entrusting

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow


def wire(window: "MainWindow") -> None:
    """Join all rooms of a window; of one signal, in the order in which they hear it."""
    for join in (
        *(_connection, _settings, _views, _calibration, _tare, _measurements, _health),
        *(_recordings, _design, _lessons, _guide, _news, _refusals, _skin, _foot),
    ):
        join(window)


def _connection(window: "MainWindow") -> None:
    connection, happenings = window.panels.connection, window.happenings
    connection.connect_wanted.connect(guarded(window.connect_to))
    connection.disconnect_wanted.connect(guarded(window.session.disconnect_from))
    connection.ports_wanted.connect(guarded(window.plugs.look))
    window.plugs.found.connect(guarded(connection.show_ports))
    window.session.reported.connect(guarded(happenings.follow))
    window.badge.clicked.connect(guarded(happenings.open_list))
    window.staging.played.connect(guarded(connection.show_source))


def _settings(window: "MainWindow") -> None:
    window.panels.wished.connect(guarded(window.wishes.wish))
    window.panels.reset_wanted.connect(guarded(window.wishes.reset_panel))
    window.compare.form.reset_wanted.connect(guarded(window.wishes.reset_panel))
    window.history.changed.connect(guarded(window.news.follow_settings))


def _views(window: "MainWindow") -> None:
    session, presenting = window.session, window.presenting
    session.estimated.connect(guarded(window.display.show_estimate))
    session.reported.connect(guarded(window.news.follow))
    session.estimated.connect(guarded(presenting.receive))
    session.reported.connect(guarded(presenting.follow))
    presenting.stage.fitted.connect(guarded(window.display.scale.show_unit))
    presenting.stage.fitted.connect(guarded(window.timeline.clock.show_unit))
    window.naming.named.connect(guarded(window.object.show_text))
    window.naming.found.connect(guarded(presenting.find))
    overlays = window.display.overlays
    window.naming.found.connect(guarded(lambda what, _: overlays.find(what)))


def _calibration(window: "MainWindow") -> None:
    session, calibrating = window.session, window.calibrating
    calibrating.laid.connect(guarded(session.lay))
    session.reported.connect(guarded(calibrating.follow))
    session.reported.connect(guarded(window.opening.follow))  # who may load a calibration then
    session.estimated.connect(guarded(calibrating.receive))
    window.panels.calibrate.attend(calibrating)
    window.panels.in_use.attend(calibrating)


def _tare(window: "MainWindow") -> None:
    taring, calibrating = window.taring, window.calibrating
    allow = window.actions_by_name.allow
    window.session.reported.connect(guarded(taring.follow))
    taring.changed.connect(guarded(lambda: allow("tare", taring.why_not)))
    calibrating.changed.connect(
        guarded(lambda: taring.stand_aside(calibrating.procedure is not None))
    )
    window.panels.tare.attend(taring)


def _measurements(window: "MainWindow") -> None:
    """What accuracy costs, and which shapes are seen how well."""
    session, costing, seeing = window.session, window.costing, window.seeing
    window.docks["cost"].visibilityChanged.connect(guarded(costing.watch))
    session.reported.connect(guarded(costing.follow))
    session.estimated.connect(guarded(costing.receive))
    window.cost.attend(costing)
    window.docks["stability"].visibilityChanged.connect(guarded(seeing.watch))
    session.reported.connect(guarded(seeing.follow))
    stability, stack = window.stability, window.history.stack
    stability.attend(seeing)
    stability.demonstrated.connect(guarded(window.wishes.demonstrate))
    stability.back.connect(guarded(stack.undo))
    stability.shown.connect(guarded(window.news.show_shape))
    show_back = partial(_show_back, window)
    stack.indexChanged.connect(guarded(show_back))
    show_back()


def _show_back(window: "MainWindow", *_: object) -> None:
    window.stability.show_undo(window.wishes.demonstrates)


def _health(window: "MainWindow") -> None:
    session, testing, resting = window.session, window.testing, window.resting
    session.reported.connect(guarded(testing.follow))
    session.estimated.connect(guarded(testing.receive))
    testing.begun.connect(guarded(resting.hold))
    session.playing.connect(guarded(lambda *_: testing.running and resting.hold()))
    testing.changed.connect(guarded(resting.let_go))
    testing.asked.connect(guarded(window.display.ask_for))
    window.health.pointed.connect(guarded(window.display.point))
    window.health.attend(testing)


def _recordings(window: "MainWindow") -> None:
    session, taping, replaying = window.session, window.taping, window.replaying
    session.reported.connect(guarded(taping.follow))
    entrusting = Entrusting(window.history, session.engine)
    session.reported.connect(guarded(entrusting.follow))
    taping.changed.connect(
        guarded(lambda: window.header.show_written(taping.written, taping.ended))
    )
    window.mark.clicked.connect(guarded(taping.dismiss))
    replaying.opened.connect(guarded(window.panels.connection.show_source))
    replaying.offered.connect(guarded(window.panels.show_recording))
    taping.repairs.saved.connect(guarded(replaying.open_file))
    window.panels.recording.attend(taping, replaying)
    window.docks["compare"].visibilityChanged.connect(guarded(window.comparing.watch))
    session.reported.connect(guarded(window.comparing.follow))
    window.compare.form.wished.connect(guarded(window.wishes.wish))
    window.compare.attend(window.comparing)


def _design(window: "MainWindow") -> None:
    design, designing = window.design, window.designing
    window.docks["design"].visibilityChanged.connect(guarded(designing.watch))
    window.session.reported.connect(guarded(designing.follow))
    design.form.wished.connect(guarded(window.wishes.wish))
    design.form.reset_wanted.connect(guarded(window.wishes.reset_panel))
    design.save_wanted.connect(
        guarded(lambda: window.staging.save_as("design.scene.toml", designing.write))
    )
    design.attend(designing)


def _lessons(window: "MainWindow") -> None:
    window.lesson.attend(window.teaching)
    window.docks["lesson"].closed.connect(guarded(window.teaching.leave))
    window.teaching.pointed.connect(guarded(window.pointing.point))
    window.teaching.taken_up.connect(guarded(partial(window.docks.reveal, "lesson")))


def _guide(window: "MainWindow") -> None:
    for panel in (*window.panels.all(), window.compare.form, window.design.form):
        panel.read_wanted.connect(guarded(lambda name: window.read(page_called(name))))


def _news(window: "MainWindow") -> None:
    """What is said in passing, or offered."""
    window.offer.offered.connect(guarded(window.actions_by_name.retell))
    for room in (
        *(window.happenings, window.taring, window.taping, window.replaying, window.teaching),
        *(window.staging, window.opening, window.layouts, window.exports),
    ):
        room.told.connect(guarded(window.tell))


def _refusals(window: "MainWindow") -> None:
    session, panels = window.session, window.panels
    session.reported.connect(guarded(window.wishes.follow))
    session.refused.connect(guarded(panels.shape.show_refusal))
    session.refused.connect(guarded(panels.load.show_refusal))
    session.unsent.connect(guarded(panels.publish.show_refusal))
    session.preparing.connect(guarded(panels.shape.show_preparing))


def _skin(window: "MainWindow") -> None:
    wishes, drag = window.wishes, window.membrane.drag
    # Queued: the next look comes after the picture is out, and need not wait for the timer.
    window.membrane.drawn.connect(window.session.tick, Qt.ConnectionType.QueuedConnection)
    drag.grabbed.connect(guarded(wishes.grab))
    drag.dragged.connect(guarded(wishes.drag))
    drag.released.connect(guarded(wishes.release))
    drag.given_up.connect(guarded(wishes.give_up))
    for name, heatmap in window.heatmaps.items():
        heatmap.pointed.connect(guarded(window.display.point))
        heatmap.chosen.connect(guarded(wishes.choose))
        heatmap.lock_wanted.connect(guarded(partial(wishes.wish, f"range_{name}")))
    window.picking.picked.connect(guarded(lambda _: _show_element(window)))
    measuring = window.display.measuring
    measuring.stepped.connect(
        guarded(lambda words, *places: window.history.step(words, measuring.have, *places))
    )
    window.display.scale.lock_wanted.connect(guarded(window.looking.lock))


def _show_element(window: "MainWindow") -> None:
    window.docks.reveal("element")
    window.layouts.note()  # a step of its own, before that of the element


def _foot(window: "MainWindow") -> None:
    doing, activity = window.doing, window.activity
    window.session.reported.connect(guarded(doing.follow))
    doing.told.connect(guarded(lambda words: activity.show_work(words, doing.may_cancel)))
    activity.cancel_wanted.connect(guarded(doing.cancel))
