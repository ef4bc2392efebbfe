import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from kappaskin_app.features.compare.panel import OtherForm
from kappaskin_app.features.design.panel import DesignForm
from kappaskin_app.features.guide.panel import page_called
from kappaskin_app.features.operator.panel import OperatorForm
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.history import History
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import scene_of
from kappaskin_app.theme import THEMES, apply_look


def test_every_panel_and_every_dock_says_what_it_is_for(panels) -> None:
    told = [panel.purpose for panel in (*panels.all(), OtherForm(), DesignForm(), OperatorForm())]
    told += [dock.toolTip() for dock in panels.window.docks.by_name().values()]
    assert len(told) > 30
    assert all(len(text) > 40 for text in told)


def test_what_a_panel_is_for_is_shown_in_it_as_long_as_wanted(panels) -> None:
    for panel in panels.all():
        assert not panel.about.isVisibleTo(panel)
        panel.help.click()
        assert panel.about.isVisibleTo(panel)
        panel.help.click()
        assert not panel.about.isVisibleTo(panel)


def test_it_leads_on_to_a_page_of_the_guide(panels) -> None:
    asked: list[str] = []
    for panel in panels.all():
        (link,) = re.findall(r'href="(\w+)"', panel.about.text())
        panel.guide_requested.connect(asked.append)
        panel.about.linkActivated.emit(link)
        assert page_called(asked[-1]).headings
    assert len(asked) == len(panels.all())


def test_its_buttons_stand_beside_the_title_and_inside(panels, until) -> None:
    for theme in THEMES.values():
        apply_look(theme)
        panels.show_settings(replace(Settings(), functions_x=5))
        basis = panels.basis
        until(lambda: panels.basis.corner.geometry().right() == panels.basis.rect().right())
        assert basis.rect().contains(basis.corner.geometry())
        assert basis.corner.width() >= basis.corner.sizeHint().width()
        words = basis.fontMetrics().horizontalAdvance(basis.title())
        assert basis.corner.x() > words


def test_a_panel_is_reset_in_one_step_and_offers_it_only_where_something_was_changed(
    panels,
) -> None:
    history = History(Settings())
    requests = Requests(history, SimpleNamespace(scene=scene_of(Settings())))
    history.changed.connect(panels.show_settings)
    panels.reset_requested.connect(requests.reset_panel)
    assert not any(p.reset.isVisibleTo(p) for p in panels.all() if isinstance(p, Form))
    requests.set("functions_x", 5)
    requests.set("functions_y", 6)
    requests.set("noise_rms", 0.5)
    panels.basis.reset.click()
    assert history.settings == replace(Settings(), noise_rms=0.5)
    assert not panels.basis.reset.isVisibleTo(panels.basis)
    assert panels.noise.reset.isVisibleTo(panels.noise)
    history.stack.undo()
    assert (history.settings.functions_x, history.settings.functions_y) == (5, 6)


def test_what_follows_from_a_setting_is_reset_with_it(panels) -> None:
    history = History(Settings())
    requests = Requests(history, SimpleNamespace(scene=scene_of(Settings())))
    requests.set("shape", "cylinder")
    assert history.settings.x != Settings().x
    requests.reset_panel("Shape", panels.shape.names)
    assert history.settings.shape == Settings().shape
    assert history.settings.side_x == Settings().side_x
    assert history.settings.x == pytest.approx(Settings().x)
