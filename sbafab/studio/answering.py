"""What a job answers, whoever runs it: a worker process or Python in the page itself.

What goes wrong is an answer too: bad input in the command line's words, anything else as a defect.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from functools import lru_cache

from sbafab import api
from sbafab.errors import SbafabError
from sbafab.studio.forms import keys
from sbafab.studio.jobs import JOBS, Answer, StudioJob
from sbafab.studio.model import Beat


class SupersededError(Exception):
    """Nobody waits for this answer any more."""


def answers(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """The job's answers; where it fails, the last one says why."""
    try:
        for answer in JOBS[job["do"]](job, beat):
            yield answer
            beat()
    except SupersededError:
        yield {"kind": "superseded"}
    except SbafabError as error:
        yield refusal(str(error))
    except ModuleNotFoundError as error:
        yield {"kind": "error", "message": f"this needs {error.name}, which is not installed here"}
    except MemoryError:
        yield {"kind": "error", "message": "the design takes more memory than there is"}
    except Exception:
        traceback.print_exc(file=sys.stderr)
        yield {"kind": "defect", "message": _defect()}


def refusal(sentence: str) -> Answer:
    """The answer that refuses, with the key of a design file that the sentence names first."""
    words = (word.strip(",;:()[]'\"") for word in sentence.split())
    field = next((word for word in words if _is_key(word)), None)
    return {"kind": "error", "message": sentence, **({"field": field} if field else {})}


def _is_key(word: str) -> bool:
    return word.startswith("parts.") or word in design_keys()


@lru_cache(maxsize=1)
def design_keys() -> frozenset[str]:
    """Every dotted key that a design file may have."""
    return frozenset(keys(api.schema()))


def _defect() -> str:
    kind, what = sys.exc_info()[:2]
    name = kind.__name__ if kind else "error"
    return (
        f"this is a defect of sbafab ({name}: {' '.join(str(what).split())[:200]}); go back with "
        "Undo, and report the design file"
    )
