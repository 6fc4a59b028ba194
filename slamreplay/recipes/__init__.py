"""Recipes: one question each, as a YAML file that says all its answer rests on."""

from slamreplay.recipes.recipe import LabRecipe, read_recipe

__all__ = ["LabRecipe", "read_recipe"]
