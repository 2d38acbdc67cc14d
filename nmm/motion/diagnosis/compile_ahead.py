"""What every run needs compiled, by other processes, while the run is made ready."""

from nmm.base.kernels.parallel_compile import compile_in_parallel
from nmm.base.kernels.spectra import WRITE_SPECTRA, write_spectra
from nmm.control.functions.program import PLACE, place
from nmm.control.step.equations import step
from nmm.model.robots.frame_path import follow_frame
from nmm.motion.compiled_loop import ADVANCE_SAMPLES, advance_samples
from nmm.motion.diagnosis.assessment import LINEARISE, linearise
from nmm.motion.diagnosis.error_bound import write_step_errors


def compile_a_run_in_parallel() -> None:
    """Compile in other processes what every run needs; resolver and tasks' functions are left to this one."""
    compile_in_parallel(
        *((advance_samples, ADVANCE_SAMPLES), step, (place, PLACE), follow_frame),
        *(write_step_errors, (linearise, LINEARISE), (write_spectra, WRITE_SPECTRA)),
    )
