//! Metrics for Prometheus.

use std::sync::Arc;

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};

use crate::serve::problem::Problem;
use crate::serve::state::App;

/// Metrics of the server in the OpenMetrics text format
#[utoipa::path(get, path = "/metrics", tag = "server", responses((status = 200, body = String, content_type = "text/plain")))]
pub(crate) async fn metrics(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.quick(|app| {
        app.metrics.set_state(app.database.len()?, app.database.revision()?, app.jobs.running());
        let text = app.metrics.text().map_err(|_| Problem::internal())?;
        let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
        Ok(([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-store")], text).into_response())
    })
    .await
}
