"""What long work says of itself: time elapsed, time left, and silence where it is quick or -q."""

from __future__ import annotations

from sbafab.cli.show import Stages, plain_lines


class Clock:
    """Stands still until it is told to go on."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def text(stage: str, done: int, total: int, before: float, in_stage: float) -> str:
    """Return the line of a stage that began after some seconds and has run for others."""
    clock = Clock()
    stages = Stages(clock)
    clock.now += before
    stages.report(stage, 0, total + 1)
    stages.report(stage, 0, total)
    clock.now += in_stage
    assert not stages.report(stage, done, total)
    return stages.text


def test_time_left_is_that_of_the_pace_so_far() -> None:
    said = "designs: 25 of 100, 30 per minute, 1 min 00 s elapsed, about 2 min 30 s left"
    assert text("designs", 25, 100, 10.0, 50.0) == said
    assert text("designs", 100, 200, 0.0, 50.0).startswith("designs: 100 of 200, 2 per second")
    assert text("designs", 100, 400, 0.0, 5000.0).endswith("about 4 h 10 min left")
    assert text("designs", 99, 100, 0.0, 6.0).endswith("6 s elapsed, less than 1 s left")
    # Nothing done yet, too early to tell, or nobody knows of how many.
    for done, total, in_stage in ((0, 100, 50.0), (3, 100, 0.5), (0, 0, 50.0)):
        assert not text("designs", done, total, 10.0, in_stage).endswith("left")
    assert text("trial 3", 0, 0, 11.0, 50.0) == "trial 3, 1 min 01 s elapsed"


def test_a_stage_begins_where_less_is_done_or_the_total_is_another() -> None:
    clock = Clock()
    stages = Stages(clock)
    assert stages.report("bond-width", 0, 16)
    clock.now += 4
    assert not stages.report("mask-overhang", 1, 16)
    assert stages.text.endswith("15 per minute, 4 s elapsed, about 1 min 00 s left")
    assert stages.report("sheets", 0, 3)
    assert stages.text == "sheets: 0 of 3, 4 s elapsed"


def test_plain_lines_come_now_and_then_and_verbose_ones_at_every_stage() -> None:
    for verbose, wanted in ((False, [5, 15, 25]), (True, [0, *range(1, 10), *range(10, 30)])):
        clock = Clock()
        lines: list[str] = []
        at: list[float] = []

        def put(
            text: str, lines: list[str] = lines, at: list[float] = at, c: Clock = clock
        ) -> None:
            lines.append(text)
            at.append(c.now - 100)

        tell = plain_lines(verbose, put, clock)
        for second in range(30):
            clock.now = 100.0 + second
            stage, done = divmod(second, 10)
            tell(f"stage {stage}", done, 10 + stage)
        assert [round(when) for when in at] == wanted
        assert all(line.startswith("sbafab: stage") for line in lines)
    quick: list[str] = []
    clock = Clock()
    tell = plain_lines(False, quick.append, clock)
    tell("quick", 0, 2)
    tell("quick", 1, 2)
    assert quick == []
