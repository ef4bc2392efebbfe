"""Studies: accuracy against time, hard cases, designs, comparisons, the paper's tables."""

from typing import TYPE_CHECKING

from kappaskin._lazy import lazy_names

if TYPE_CHECKING:
    from kappaskin.studies.as_printed import misprints as misprints
    from kappaskin.studies.compare.measure import compared as compared
    from kappaskin.studies.compare.table import compared_text as compared_text
    from kappaskin.studies.cost.accuracy import length_of as length_of
    from kappaskin.studies.cost.accuracy import verdict as verdict
    from kappaskin.studies.cost.background import Effects as Effects
    from kappaskin.studies.cost.background import Measuring as Measuring
    from kappaskin.studies.cost.bench import costs as costs
    from kappaskin.studies.cost.choice import cheapest as cheapest
    from kappaskin.studies.cost.choice import frontier as frontier
    from kappaskin.studies.cost.effects import EffectCost as EffectCost
    from kappaskin.studies.cost.effects import effect_costs as effect_costs
    from kappaskin.studies.cost.effects import usual_setting as usual_setting
    from kappaskin.studies.cost.setting import Cost as Cost
    from kappaskin.studies.cost.setting import Refused as Refused
    from kappaskin.studies.cost.setting import Setting as Setting
    from kappaskin.studies.cost.setting import settings_to_try as settings_to_try
    from kappaskin.studies.cost.table import costs_text as costs_text
    from kappaskin.studies.cost.table import effect_rows as effect_rows
    from kappaskin.studies.cost.table import effects_text as effects_text
    from kappaskin.studies.cost.table import rows as rows
    from kappaskin.studies.design.folder import Folder as Folder
    from kappaskin.studies.design.page import page_of as page_of
    from kappaskin.studies.design.prospect import Check as Check
    from kappaskin.studies.design.prospect import Design as Design
    from kappaskin.studies.design.prospect import Prospect as Prospect
    from kappaskin.studies.design.prospect import check as check
    from kappaskin.studies.design.prospect import prospect as prospect
    from kappaskin.studies.design.run import known_of as known_of
    from kappaskin.studies.design.run import run_study as run_study
    from kappaskin.studies.design.study import load_study as load_study
    from kappaskin.studies.design.table import table_csv as table_csv
    from kappaskin.studies.design.table import table_text as table_text
    from kappaskin.studies.design.workers import Workers as Workers
    from kappaskin.studies.design.workers import cluster as cluster
    from kappaskin.studies.design.workers import processes as processes
    from kappaskin.studies.drills.run import run_drills as run_drills
    from kappaskin.studies.drills.text import drills_text as drills_text
    from kappaskin.studies.figures.cost import check_plot as check_plot
    from kappaskin.studies.figures.cost import write_plot as write_plot
    from kappaskin.studies.figures.registry import FIGURES as FIGURES
    from kappaskin.studies.figures.registry import write_figures as write_figures
    from kappaskin.studies.figures.study import draw_study as draw_study
    from kappaskin.studies.plan import plan_rows as plan_rows
    from kappaskin.studies.plan import plan_text as plan_text
    from kappaskin.studies.plan import plan_told as plan_told
    from kappaskin.studies.regions import run_regions as run_regions
    from kappaskin.studies.simulated import simulated_readings as simulated_readings
    from kappaskin.studies.stability.run import run_stability as run_stability
    from kappaskin.studies.stability.text import stability_text as stability_text
    from kappaskin.studies.tables import paper_tables as paper_tables
    from kappaskin.studies.text import misprints_text as misprints_text
    from kappaskin.studies.text import regions_text as regions_text
    from kappaskin.studies.text import tables_text as tables_text
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "as_printed": "misprints",
            "compare.measure": "compared",
            "compare.table": "compared_text",
            "cost.accuracy": "length_of verdict",
            "cost.background": "Effects Measuring",
            "cost.bench": "costs",
            "cost.choice": "cheapest frontier",
            "cost.effects": "EffectCost effect_costs usual_setting",
            "cost.setting": "Cost Refused Setting settings_to_try",
            "cost.table": "costs_text effect_rows effects_text rows",
            "design.folder": "Folder",
            "design.page": "page_of",
            "design.prospect": "Check Design Prospect check prospect",
            "design.run": "known_of run_study",
            "design.study": "load_study",
            "design.table": "table_csv table_text",
            "design.workers": "Workers cluster processes",
            "drills.run": "run_drills",
            "drills.text": "drills_text",
            "figures.cost": "check_plot write_plot",
            "figures.registry": "FIGURES write_figures",
            "figures.study": "draw_study",
            "plan": "plan_rows plan_text plan_told",
            "regions": "run_regions",
            "simulated": "simulated_readings",
            "stability.run": "run_stability",
            "stability.text": "stability_text",
            "tables": "paper_tables",
            "text": "misprints_text regions_text tables_text",
        },
    )
