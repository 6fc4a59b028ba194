"""Recipes: one question each, as a YAML file that says all its answer rests on."""

from slamreplay.recipes.budget import BudgetRecipe
from slamreplay.recipes.dose_recipe import DoseRecipe
from slamreplay.recipes.gate_recipe import GateRecipe
from slamreplay.recipes.lab_recipe import LabRecipe
from slamreplay.recipes.recipe import Recipe, read_demands, read_recipe

__all__ = [
    "BudgetRecipe",
    "DoseRecipe",
    "GateRecipe",
    "LabRecipe",
    "Recipe",
    "read_demands",
    "read_recipe",
]
