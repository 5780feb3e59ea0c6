//! One conversion from the core's errors to Python's.

use map3d_base::Error;
use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

create_exception!(map3d._core, CoreError, PyException);
create_exception!(map3d._core, FormatError, CoreError);
create_exception!(map3d._core, SceneRebuilt, FormatError);
create_exception!(map3d._core, LimitError, CoreError);
create_exception!(map3d._core, InvalidArgument, CoreError);
create_exception!(map3d._core, StorageError, CoreError);
create_exception!(map3d._core, Interrupted, CoreError);

pub fn to_python(error: Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::Format { .. } => FormatError::new_err(text),
        Error::Rebuilt { .. } => SceneRebuilt::new_err(text),
        Error::Limit { .. } | Error::Deadline { .. } => LimitError::new_err(text),
        Error::Argument(_) => InvalidArgument::new_err(text),
        Error::Storage { .. } => StorageError::new_err(text),
        Error::Interrupted => Interrupted::new_err(text),
    }
}

/// An `InvalidArgument` that the binding itself raises.
pub fn invalid(text: impl Into<String>) -> PyErr {
    InvalidArgument::new_err(text.into())
}
