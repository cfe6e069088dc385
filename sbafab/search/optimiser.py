"""The same search by Optuna, whose storage keeps it, resumes it and shares it between machines."""

from __future__ import annotations

from typing import Any

from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.search.space import SearchSpace
from sbafab.search.trial import IMPOSSIBLE
from sbafab.search.walks import WALK_SHARE

EXTRA = 'Optuna is not installed: pip install "sbafab[optuna]"'
SEED = 20_240


def with_optuna(search: SearchSpace, storage: str | None) -> None:
    """Tries designs, and leaves a share for the last steps. Raises DesignError without the extra.

    ``storage`` is the URL of the database in which the search goes on.
    """
    try:
        import optuna
    except ImportError:
        raise DesignError(EXTRA) from None
    # Of a search that is stopped it would tell a trial that failed, with a traceback.
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    tries = max(1, round(WALK_SHARE * search.tries))
    try:
        study = optuna.create_study(
            storage=storage,
            study_name=_name(search),
            load_if_exists=True,
            sampler=optuna.samplers.TPESampler(seed=SEED, n_startup_trials=tries // 4),
        )
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise DesignError(
            f"--storage {storage} cannot be used ({said}); write for example "
            "--storage sqlite:///search.db"
        ) from None

    def objective(trial: Any) -> float:
        place = tuple(
            trial.suggest_int(free.key, 0, count - 1)
            for free, count in zip(search.free, search.counts, strict=True)
        )
        found = search.trial(place)
        # What misses is worse than all that holds, by how much it misses.
        return found.cost if found.holds else IMPOSSIBLE * (1 + min(found.missed, IMPOSSIBLE))

    # What is stored was tried by an earlier run: here it is looked up again, and tried no more.
    done = study.get_trials(states=[optuna.trial.TrialState.COMPLETE])
    for old in done:
        search.trial(tuple(old.params[free.key] for free in search.free))
    study.optimize(objective, n_trials=max(0, tries - len(done)))


def _name(search: SearchSpace) -> str:
    asked = [one.said for one in search.wanted.requirements]
    keys = [f"{one.key} {one.low:g} to {one.high:g} by {one.step:g}" for one in search.free]
    design = search.wanted.design
    return "; ".join(
        [f"{design.name} {design_sha256(design)[:12]}", *asked, search.wanted.goal.said, *keys]
    )
