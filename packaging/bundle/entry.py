"""What the bundle runs: the command `kappaskin`, and a module by -m where Python itself would."""

import multiprocessing
import runpy
import sys

if __name__ == "__main__":
    multiprocessing.freeze_support()  # first: the engine's process need not load what comes now
    if sys.argv[1:2] == ["-m"]:  # from the library, which begins programs by `sys.executable`
        sys.argv[:3] = sys.argv[2:3]
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    else:
        from kappaskin.cli import main

        sys.exit(main(sys.argv[1:] or ["app"]))
