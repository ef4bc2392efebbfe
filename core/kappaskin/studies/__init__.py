"""Studies: accuracy against time, hard cases, designs, comparisons, the paper's tables."""

from typing import TYPE_CHECKING

from kappaskin._lazy import lazy_names

if TYPE_CHECKING:
    from kappaskin.studies.compare import compared as compared
    from kappaskin.studies.compare import compared_text as compared_text
    from kappaskin.studies.cost import Cost as Cost
    from kappaskin.studies.cost import Refused as Refused
    from kappaskin.studies.cost import Setting as Setting
    from kappaskin.studies.cost import cheapest as cheapest
    from kappaskin.studies.cost import frontier as frontier
    from kappaskin.studies.cost import settings_to_try as settings_to_try
    from kappaskin.studies.cost.bench import EffectCost as EffectCost
    from kappaskin.studies.cost.bench import EffectCosts as EffectCosts
    from kappaskin.studies.cost.bench import cost_steps as cost_steps
    from kappaskin.studies.cost.bench import costs as costs
    from kappaskin.studies.cost.bench import effect_costs as effect_costs
    from kappaskin.studies.cost.bench import usual_setting as usual_setting
    from kappaskin.studies.cost.report import accuracy_verdict as accuracy_verdict
    from kappaskin.studies.cost.report import check_plot as check_plot
    from kappaskin.studies.cost.report import cost_rows as cost_rows
    from kappaskin.studies.cost.report import costs_text as costs_text
    from kappaskin.studies.cost.report import effect_rows as effect_rows
    from kappaskin.studies.cost.report import effects_text as effects_text
    from kappaskin.studies.cost.report import parse_length as parse_length
    from kappaskin.studies.cost.report import write_plot as write_plot
    from kappaskin.studies.design import run_study as run_study
    from kappaskin.studies.design import study_workers as study_workers
    from kappaskin.studies.design.maps import check_maps_file as check_maps_file
    from kappaskin.studies.design.maps import design_maps as design_maps
    from kappaskin.studies.design.maps import maps_rows as maps_rows
    from kappaskin.studies.design.maps import maps_text as maps_text
    from kappaskin.studies.design.maps import write_maps as write_maps
    from kappaskin.studies.design.measures import Check as Check
    from kappaskin.studies.design.measures import Design as Design
    from kappaskin.studies.design.measures import Prospect as Prospect
    from kappaskin.studies.design.measures import check as check
    from kappaskin.studies.design.measures import prospect as prospect
    from kappaskin.studies.design.report import table_text as table_text
    from kappaskin.studies.design.report import write_report as write_report
    from kappaskin.studies.design.results import StudyFolder as StudyFolder
    from kappaskin.studies.design.study import load_study as load_study
    from kappaskin.studies.drills import drills_text as drills_text
    from kappaskin.studies.drills import run_drills as run_drills
    from kappaskin.studies.figures import FIGURES as FIGURES
    from kappaskin.studies.figures import write_figures as write_figures
    from kappaskin.studies.paper import misprints as misprints
    from kappaskin.studies.paper import misprints_text as misprints_text
    from kappaskin.studies.paper import paper_tables as paper_tables
    from kappaskin.studies.paper import tables_text as tables_text
    from kappaskin.studies.regions import regions_text as regions_text
    from kappaskin.studies.regions import run_regions as run_regions
    from kappaskin.studies.simulation import plan_rows as plan_rows
    from kappaskin.studies.simulation import plan_text as plan_text
    from kappaskin.studies.simulation import plan_updates as plan_updates
    from kappaskin.studies.simulation import simulated_readings as simulated_readings
    from kappaskin.studies.stability import run_stability as run_stability
    from kappaskin.studies.stability import stability_text as stability_text
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        ("compare", "compared compared_text"),
        ("cost", "Cost Refused Setting cheapest frontier settings_to_try"),
        (
            "cost.bench",
            "EffectCost EffectCosts cost_steps costs effect_costs usual_setting",
        ),
        (
            "cost.report",
            "accuracy_verdict check_plot cost_rows costs_text effect_rows effects_text "
            "parse_length write_plot",
        ),
        ("design", "run_study study_workers"),
        ("design.maps", "check_maps_file design_maps maps_rows maps_text write_maps"),
        ("design.measures", "Check Design Prospect check prospect"),
        ("design.report", "table_text write_report"),
        ("design.results", "StudyFolder"),
        ("design.study", "load_study"),
        ("drills", "drills_text run_drills"),
        ("figures", "FIGURES write_figures"),
        ("paper", "misprints misprints_text paper_tables tables_text"),
        ("regions", "regions_text run_regions"),
        ("simulation", "plan_rows plan_text plan_updates simulated_readings"),
        ("stability", "run_stability stability_text"),
    )
