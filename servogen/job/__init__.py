"""Job file -> `Job`: chip, servos, motion and frame, checked."""

from servogen.job.job import Firmware, Job
from servogen.job.load import load, load_calibrated, load_walking, loads
from servogen.job.template import template

__all__ = ["Firmware", "Job", "load", "load_calibrated", "load_walking", "loads", "template"]
