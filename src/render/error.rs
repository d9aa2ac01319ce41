//! Why a picture was not drawn or written.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use crate::volume::display_path;

/// Why a picture was not drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There are no data to draw.
    #[error("nothing to draw: {missing}")]
    NoData {
        /// What is missing, as a clause.
        missing: &'static str,
    },
    /// The plotting library failed.
    #[error("the plot cannot be drawn: {message}")]
    Plot {
        /// The library's message.
        message: String,
    },
    /// The PNG encoder failed.
    #[error("the picture cannot be encoded as PNG")]
    Encode {
        /// The encoder's error.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
    /// The file cannot be written.
    #[error("{}: the picture cannot be written", display_path(path))]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },
}

impl RenderError {
    pub(super) fn encode(source: impl Error + Send + Sync + 'static) -> Self {
        Self::Encode { source: Box::new(source) }
    }

    pub(super) fn write(path: impl Into<PathBuf>, source: io::Error) -> Self {
        Self::Write { path: path.into(), source }
    }
}
