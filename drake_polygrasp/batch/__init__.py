"""Plans grasps of many objects: each in a child process, with exactly one committed result.

| file | what it holds |
|---|---|
| run.py | `plan_batch`, `iter_batch`: finds objects without a result, commits results |
| request.py | a batch as it is asked for, and the checks of its arguments |
| options.py | the options of loading and planning, as values that have a key |
| sources.py | finds model files, one after the other |
| keys.py | keys of results, of contents, options and versions |
| reader.py | what a child process runs that reads models for their keys |
| supervisor.py | runs tasks in warm children, each within its time and memory |
| warm_child.py | a child process from the driver's side: talks to it, measures and kills it |
| child.py | the program of a child process |
| worker.py | what children run that plan one object |
| engines.py | runs tasks in children of this process, or in chunks on an executor |
| dask_cluster.py | connects to a Dask cluster |
| outputs.py | where grasp files go: a folder or a bucket |
| store.py | the rows of results, in SQLite |
| reading.py | reads the rows of all drivers of an output |
| status.py | counts, the slowest, largest and worst objects, rate, time left |
| parquet.py | exports grasps as Parquet |
| rows.py | the row of a result |
| driver_lock.py | one driver for each output |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.batch.parquet import export_parquet
    from drake_polygrasp.batch.run import BatchReport, iter_batch, plan_batch
    from drake_polygrasp.batch.status import BatchStatus, read_status

__all__ = [
    "BatchReport",
    "BatchStatus",
    "export_parquet",
    "iter_batch",
    "plan_batch",
    "read_status",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "parquet": ("export_parquet",),
        "status": ("BatchStatus", "read_status"),
        "run": ("BatchReport", "iter_batch", "plan_batch"),
    },
)
