"""Design studies: a scene and what of it is varied, to how well shapes and contacts are told."""

from kappaskin.studies.design.folder import Folder as Folder
from kappaskin.studies.design.known import Known as Known
from kappaskin.studies.design.known import Mean as Mean
from kappaskin.studies.design.measures import MEASURES as MEASURES
from kappaskin.studies.design.measures import Measure as Measure
from kappaskin.studies.design.prospect import Check as Check
from kappaskin.studies.design.prospect import Design as Design
from kappaskin.studies.design.prospect import Prospect as Prospect
from kappaskin.studies.design.prospect import check as check
from kappaskin.studies.design.prospect import prospect as prospect
from kappaskin.studies.design.run import known_of as known_of
from kappaskin.studies.design.run import run_study as run_study
from kappaskin.studies.design.study import STUDIES as STUDIES
from kappaskin.studies.design.study import Study as Study
from kappaskin.studies.design.study import load_study as load_study
from kappaskin.studies.design.study import read_study as read_study
from kappaskin.studies.design.task import Task as Task
from kappaskin.studies.design.task import run as run
from kappaskin.studies.design.workers import cluster as cluster
from kappaskin.studies.design.workers import processes as processes
