"""``make bench`` or ``python -m benchmarks``: checks that everyone gives the same results, measures, writes results.md and cost.png.

``--quick`` does all of it with a few runs and steps and writes nothing; ``--single`` prints what a step of one target costs and writes nothing.
"""

import os
import sys

if __name__ == "__main__":
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # one core each; NumPy reads this when it is imported
        os.environ[name] = "1"
    os.environ["TQDM_DISABLE"] = "1"

    from benchmarks.run import main

    sys.exit(main())
