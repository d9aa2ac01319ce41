//! What is counted, for Prometheus.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use super::problem::Problem;
use super::state::App;

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Answered {
    method: String,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Route {
    route: String,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Asked {
    space: String,
    index: String,
}

/// What is counted.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Answered, Counter>,
    latency: Family<Route, Histogram, fn() -> Histogram>,
    searches: Family<Asked, Histogram, fn() -> Histogram>,
    textures: Gauge,
    revision: Gauge,
    running: Gauge,
}

impl Metrics {
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("hlacdb");
        let requests = Family::default();
        registry.register("requests", "Requests answered", requests.clone());
        // From a quarter of a millisecond to eight seconds.
        let latency: Family<_, _, fn() -> Histogram> =
            Family::new_with_constructor(|| Histogram::new(exponential_buckets(0.000_25, 2.0, 16)));
        let what = "Time from a request's head to its answer's head";
        registry.register_with_unit("request_duration", what, Unit::Seconds, latency.clone());
        // From a microsecond to a second.
        let searches: Family<_, _, fn() -> Histogram> =
            Family::new_with_constructor(|| Histogram::new(exponential_buckets(0.000_001, 4.0, 11)));
        let what = "Time of the search alone, from point to ranked hits";
        registry.register_with_unit("search_duration", what, Unit::Seconds, searches.clone());
        let (textures, revision, running) = (Gauge::default(), Gauge::default(), Gauge::default());
        registry.register("textures", "Textures in the store", textures.clone());
        registry.register("revision", "The number of the store's last commit", revision.clone());
        registry.register("jobs_running", "Jobs that are running", running.clone());
        Self { registry, requests, latency, searches, textures, revision, running }
    }

    /// Counts a search.
    pub(crate) fn searched(&self, space: &str, index: &str, elapsed: Duration) {
        let asked = Asked { space: space.to_owned(), index: index.to_owned() };
        self.searches.get_or_create(&asked).observe(elapsed.as_secs_f64());
    }

    fn answered(&self, method: &Method, route: &str, status: u16, elapsed: Duration) {
        let answered = Answered { method: method.to_string(), route: route.to_owned(), status };
        self.requests.get_or_create(&answered).inc();
        self.latency.get_or_create(&Route { route: route.to_owned() }).observe(elapsed.as_secs_f64());
    }

    fn text(&self) -> Result<String, fmt::Error> {
        let mut buffer = String::new();
        text::encode(&mut buffer, &self.registry)?;
        Ok(buffer)
    }
}

/// Counts every request by its route, so that ids do not make a series each.
pub(crate) async fn count(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let began = std::time::Instant::now();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().map_or("(page)", MatchedPath::as_str).to_owned();
    let response = next.run(request).await;
    app.metrics.answered(&method, &route, response.status().as_u16(), began.elapsed());
    response
}

/// Everything that is counted, as Prometheus reads it
#[utoipa::path(get, path = "/metrics", tag = "server", responses((status = 200, body = String, content_type = "text/plain")))]
pub(crate) async fn metrics(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.quick(|app| {
        app.metrics.textures.set(app.database.len()? as i64);
        app.metrics.revision.set(app.database.revision()? as i64);
        app.metrics.running.set(app.jobs.running() as i64);
        let text = app.metrics.text().map_err(|_| Problem::internal())?;
        let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
        Ok(([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-store")], text).into_response())
    })
    .await
}
