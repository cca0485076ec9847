"""All sections with figures of the paper, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.evaluation.headless import TrainedProject
from app.lab.pictures import Pictures
from app.lab.report.comparison import Compared
from app.lab.report.page.parts import Section
from app.lab.report.paper_figures.beside_tables import paper_ablations_section, paper_tables_section
from app.lab.report.paper_figures.by_hand import Places
from app.lab.report.paper_figures.change_maps import change_maps_section
from app.lab.report.paper_figures.crops import crops_section
from app.lab.report.paper_figures.features import features_section
from app.lab.report.paper_figures.over_length import clip_length_section, sequence_length_section
from app.lab.report.paper_figures.pictured import pictured_projects
from app.lab.report.paper_figures.spheres import spheres_section
from engine.capture.capture_summary import describe

STEPS = 4
"""How often `tick` is called."""


def paper_sections(
    compared: Sequence[Compared],
    own_pictures: Pictures,
    opened: TrainedProject,
    make_pictures: Callable[[TrainedProject], Pictures],
    places: Places,
    tick: Callable[[], None],
) -> list[Section]:
    """Tables of the paper where some fit; maps and crops where there are two projects, or a place was chosen by hand;
    figures over length where lengths differ; static and dynamic features, and spheres around anchors, always.

    Args:
        compared: The page's own project first.
        own_pictures: Of that.
        opened: That project.
    """
    projects, left_out = pictured_projects(compared, own_pictures, opened, make_pictures)
    has_others = len(projects) > 1
    sections = [paper_ablations_section(compared), paper_tables_section(compared, describe(opened.capture))]
    if has_others or places.boundary is not None or places.camera is not None:
        sections.append(change_maps_section(projects, places, left_out))
    tick()
    if has_others or places.windows:
        sections.append(crops_section(projects, places, left_out))
    tick()
    sections.append(features_section(projects[0]))
    tick()
    sections.append(spheres_section(projects[0], opened, places))
    tick()
    if len(compared) > 1:
        sections += [clip_length_section(compared), sequence_length_section(compared)]
    return [section for section in sections if section is not None]
