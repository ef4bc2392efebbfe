"""What accuracy costs: settings to their error, time and memory, and which of them to choose."""

from kappaskin.studies.cost.accuracy import Verdict as Verdict
from kappaskin.studies.cost.accuracy import length_of as length_of
from kappaskin.studies.cost.accuracy import verdict as verdict
from kappaskin.studies.cost.background import Effects as Effects
from kappaskin.studies.cost.background import Measuring as Measuring
from kappaskin.studies.cost.bench import Bench as Bench
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
