"""JoinedCluster: a cluster on which clips of one project train, as command line and window use it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from app.cluster.cluster import Cluster
from app.cluster.cluster_worker import ClusterWorker
from app.plan.forecasts import Kind, plans_of_kinds
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.portable import NATIVE, Processor
from engine.training.plan.plan import TrainingPlan


class JoinedCluster:
    """Joins at once, which may take a minute. Close it at the end.

    Attributes:
        cluster: Its computers.
        kinds: The plan of each kind of clip that is left.

    Args:
        address: See Cluster.
        project, capture: What is trained.
        to_train: The clips that are left.
        catalog: Of the project.
        cpu: See Cluster.
    Raises:
        ProjectError, TrainingError: As of Cluster.
    """

    def __init__(
        self,
        address: str,
        project: Project,
        capture: Capture,
        to_train: Sequence[Clip],
        catalog: ClipCatalog,
        *,
        cpu: Processor = NATIVE,
    ) -> None:
        self.kinds: dict[Kind, TrainingPlan] = plans_of_kinds(project, capture, to_train, catalog)
        memory_mb = max((plan.memory_mb for plan in self.kinds.values()), default=0.0)
        self.cluster = Cluster(address, project, capture, n_bytes=int(memory_mb * 1e6), cpu=cpu)

    @property
    def launch(self) -> Launch:
        """Starts the worker of a clip on one of its computers."""
        return partial(ClusterWorker, cluster=self.cluster)

    @property
    def n_slots(self) -> int:
        """How many clips may train side by side now; cheap."""
        return self.cluster.n_slots

    def close(self) -> None:
        """Let go of it; may take seconds."""
        self.cluster.close()
