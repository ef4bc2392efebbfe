"""Bases: sets of functions on a skin that satisfy its boundary conditions."""

from kappaskin.bases.basis import ORDERS as ORDERS
from kappaskin.bases.basis import Basis as Basis
from kappaskin.bases.basis import CurvatureMap as CurvatureMap
from kappaskin.bases.basis import ValueMap as ValueMap
from kappaskin.bases.basis import curvature_at as curvature_at
from kappaskin.bases.basis import curvature_terms as curvature_terms
from kappaskin.bases.edges import EDGES as EDGES
from kappaskin.bases.edges import basis_for as basis_for
from kappaskin.bases.edges import check_edge as check_edge
from kappaskin.bases.edges import edges_of as edges_of
from kappaskin.bases.product import ElasticBasis as ElasticBasis
from kappaskin.bases.product import ProductBasis as ProductBasis
from kappaskin.bases.product import SineBasis as SineBasis
from kappaskin.bases.product import gauss as gauss
from kappaskin.bases.product import overlaps as overlaps
