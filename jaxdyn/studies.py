"""Old names of answers to single problems, which moved beside their one caller in version 0.3."""

from jaxdyn._doors import attribute_getter

__getattr__ = attribute_getter(
    __name__,
    modules={
        "rod_or_spring": "jaxdyn.course.two_masses_and_rod",
        "satellite_claims": "jaxdyn.course.satellite_claims",
        "sleeping_top": "jaxdyn.course.spinning_top",
        "upright": "jaxdyn.hard.cases.shaken",
    },
)
