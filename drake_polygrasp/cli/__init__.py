"""The `polygrasp` command: one file per subcommand, with its options and its call.

| file | what it holds |
|---|---|
| main.py | parses the arguments, runs a subcommand, returns the exit code |
| plan.py | `polygrasp plan` |
| plan_table.py | the table and JSON of `polygrasp plan` |
| hand_plan.py | `polygrasp plan --hand` |
| hand.py | `polygrasp hand check` |
| verify.py | `polygrasp verify` |
| verify_table.py | the table and JSON of `polygrasp verify` |
| explain.py | `polygrasp explain` |
| explain_table.py | the table and JSON of `polygrasp explain` |
| show.py | `polygrasp show` |
| shown_scene.py | loads what `show` displays, from a grasp file or a model, and serves it |
| export.py | `polygrasp export` |
| batch.py | `polygrasp batch` |
| batch_results.py | `polygrasp batch status` and `polygrasp batch export` |
| batch_table.py | the output of `polygrasp batch` and `polygrasp batch status` |
| options.py | options that several subcommands share |
| values.py | parses and validates option values |
| table.py | columns and lines that several tables share |
| reporting.py | exit codes, lines on standard error, JSON text |
| calls.py | loads the model and sets limits for the library's calls |
| child_process.py | calls a function in a child process of bounded time and memory |
| child_messages.py | the pipe by which a command in a child process tells its parent |
| progress_line.py | shows progress on a terminal |
"""

from drake_polygrasp.cli.main import main

__all__ = ["main"]
