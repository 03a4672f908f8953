"""Exercises for a class: nodes with a part left to write, and the answer held against theirs."""

from lodeline.grading.exercise import EXERCISES, Exercise
from lodeline.grading.grade import Grade, grade
from lodeline.grading.patience import GradingError

__all__ = ["EXERCISES", "Exercise", "Grade", "GradingError", "grade"]
