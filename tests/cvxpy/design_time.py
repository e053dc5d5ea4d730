"""How long a design takes, beside one solve of (T2) by cvxpy with Clarabel and with SDPA, in the same run.

Random stable plants, as many tracked outputs and inputs as half the states, decay 0.97. The program's
figure is the processor time of the whole `ftc-fmu design` process, certificate and observer included;
the others' is that of one solve of the same inequalities, cvxpy's own work left out, in the coordinates
of linear-quadratic regulators: as the plant is given, they end without an answer on nearly every row. Prints a
table, or writes it between the marks of docs/performance.md. With bounds: ends with exit code 1 where one is missed.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import cvxpy as cp
import numpy as np
from scipy.linalg import solve_discrete_are

import commands
import design_file
import synthesis

# states, modes, guarantee, processor seconds allowed, whether the general solvers are asked as well.
CASES = [
    (2, 2, "common", 0.1, True),
    (8, 2, "common", 0.5, True),
    (8, 4, "common", 1.0, True),
    (12, 2, "common", 2.0, True),
    (16, 4, "common", 8.0, False),
    (24, 2, "common", 10.0, False),
    (8, 4, "dwell", 1.0, True),
    (16, 4, "dwell", 3.0, False),
    (24, 4, "dwell", 10.0, False),
    (48, 4, "dwell", 60.0, False),
]
# Processor seconds after which a general solver is stopped: all of them together stay below ten minutes.
LONGEST = 45
DECAY = 0.97
WEIGHTS = (1.0, 0.3, 0.3)
BEGIN, END = "<!-- table -->", "<!-- end of table -->"


def random_task(states: int, modes: int, lyapunov: str) -> synthesis.Task:
    """Returns a stable plant whose modes are variations of one."""
    rng = np.random.default_rng(100 * states + modes)
    half = max(1, states // 2)

    def uniform(rows: int, columns: int, spread: float = 1.0) -> np.ndarray:
        return spread * rng.uniform(-1.0, 1.0, (rows, columns))

    A = uniform(states, states)
    A *= 0.8 / np.abs(np.linalg.eigvals(A)).max()
    B, C, E = uniform(states, half), uniform(half, states), uniform(states, 1)
    drawn = [
        {
            "A": A + uniform(states, states, 0.02),
            "B": B + uniform(states, half, 0.02),
            "C": C,
            "E": E,
            "F": np.zeros((half, 1)),
        }
        for _ in range(modes)
    ]
    return synthesis.Task(drawn, 1.0, list(range(half)), 0, lyapunov, DECAY, WEIGHTS)


def ours(task: synthesis.Task, folder: Path, solver: str) -> tuple[float, list[float]]:
    """Returns the processor seconds of the whole program and its gamma per mode."""
    wy, wz, wu = task.weights
    path = design_file.write(
        {
            "name": "random",
            "sample_time": task.sample_time,
            "mode": [{key: matrix.tolist() for key, matrix in mode.items()} for mode in task.modes],
            "controller": {
                "tracked": [row + 1 for row in task.tracked],
                "lyapunov": task.lyapunov,
                "decay": task.decay,
                "output_weight": wy,
                "integral_weight": wz,
                "input_weight": wu,
            },
            "observer": {"kind": "luenberger", "decay": 0.98},
            "estimator": {"method": "none"},
            "compensation": {"method": "none"},
        },
        folder,
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [commands.PROGRAM, "--solver", solver, "design", path, "--json"], capture_output=True, text=True, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, json.loads(done.stdout)["gamma"]


def regulated(models: list[synthesis.Augmented], decay: float) -> tuple[list[synthesis.Augmented], float]:
    """Returns the models in coordinates that suit Lyapunov matrices near the identity, and the unit of their gamma."""
    mean = np.zeros_like(models[0].A)
    for model in models:
        A, B = model.A / decay, model.B / decay
        cost = solve_discrete_are(A, B, np.eye(len(A)), np.eye(B.shape[1]))
        mean += np.linalg.inv(cost) / len(models)
    view = [synthesis.in_coordinates(model, np.linalg.cholesky(mean)) for model in models]
    put, got = (max(np.linalg.norm(getattr(model, key), 2) for model in view) for key in "EH")
    return [synthesis.Augmented(m.A, m.B, m.E / put, m.H / got, m.D / got) for m in view], put * got


def _solve(task: synthesis.Task, solver: str, answer: multiprocessing.Queue) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
    models = [synthesis.augment(task, mode) for mode in task.modes]
    groups = [models] if task.lyapunov == "common" else [[model] for model in models]
    seconds, gammas = 0.0, []
    for group in groups:
        view, unit = regulated(group, task.decay)
        problem = synthesis.problem(view, task.decay)[0]
        # The first call compiles the problem; the second finds that done.
        problem.get_problem_data(solver)
        begin = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy, which the gamma in the table shows as well
            problem.solve(solver=solver)
        seconds += time.process_time() - begin
        found = problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)
        gammas.append(unit * float(np.sqrt(problem.value)) if found else float("nan"))
    answer.put((seconds, gammas))


def others(task: synthesis.Task, solver: str) -> tuple[float | None, str]:
    """Returns the seconds of one solve by a general solver, and those with its gamma, or what became of it."""
    answer: multiprocessing.Queue = multiprocessing.Queue()
    process = multiprocessing.Process(target=_solve, args=(task, solver, answer))
    process.start()
    process.join(2 * LONGEST)
    if process.is_alive():
        process.kill()
    if answer.empty():
        return None, "failed" if process.exitcode == 1 else f"over {LONGEST} s"
    seconds, gammas = answer.get()
    if np.isnan(gammas).any():
        return None, "failed"
    return seconds, f"{seconds:.2f} ({gammas[0]:.5f})"


def processor() -> str:
    """Returns the processor's name, as far as the system tells it."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def main() -> int:
    """Prints or writes the table; 1 where a bound is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", type=Path, help="the page whose table is replaced")
    parser.add_argument("--alone", action="store_true", help="leave out the general solvers")
    arguments = parser.parse_args()
    lines = [
        (
            "| states | modes | guarantee | `ftc-fmu design`, s | allowed, s | gamma, mode 1 "
            "| Clarabel, s (gamma) | SDPA, s (gamma) | the faster of them, times |"
        ),
        "|---|---|---|---|---|---|---|---|---|",
    ]
    missed, before = 0, os.getloadavg()[0]
    for states, modes, lyapunov, allowed, compared in CASES:
        task = random_task(states, modes, lyapunov)
        with tempfile.TemporaryDirectory() as folder:
            seconds, gamma = ours(task, Path(folder), "structured")
        asked = compared and not arguments.alone
        general = [others(task, solver) if asked else (None, "-") for solver in ("CLARABEL", "SDPA")]
        finished = [needed for needed, _ in general if needed is not None]
        ratio = f"{min(finished) / seconds:.1f}" if finished else "-"
        missed += seconds > allowed
        lines.append(
            f"| {states} | {modes} | {lyapunov} | {seconds:.2f} | {allowed:g} | {gamma[0]:.5f} "
            f"| {general[0][1]} | {general[1][1]} | {ratio} |"
        )
        print(lines[-1], flush=True)
    lines += [
        "",
        f"Measured on one thread of {processor()}, load {before:.1f} before and {os.getloadavg()[0]:.1f} after.",
    ]
    print(lines[-1])
    if arguments.write:
        text = arguments.write.read_text()
        head, rest = text.split(BEGIN)
        arguments.write.write_text(head + BEGIN + "\n" + "\n".join(lines) + "\n" + END + rest.split(END)[1])
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
