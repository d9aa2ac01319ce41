//! Metrics for Prometheus.

use std::fmt;
use std::time::Duration;

use axum::http::Method;
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct RequestLabels {
    method: String,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct RouteLabels {
    route: String,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct SearchLabels {
    space: String,
    index: String,
}

/// The metrics of a server.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<RequestLabels, Counter>,
    latency: Family<RouteLabels, Histogram, fn() -> Histogram>,
    searches: Family<SearchLabels, Histogram, fn() -> Histogram>,
    descriptions: Counter,
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
        let what = "Time from the head of a request to the head of its response";
        registry.register_with_unit("request_duration", what, Unit::Seconds, latency.clone());
        // From a microsecond to a second.
        let searches: Family<_, _, fn() -> Histogram> =
            Family::new_with_constructor(|| Histogram::new(exponential_buckets(0.000_001, 4.0, 11)));
        let what = "Time of the search alone, from a point to ranked hits";
        registry.register_with_unit("search_duration", what, Unit::Seconds, searches.clone());
        let descriptions = Counter::default();
        registry.register("descriptions", "Volumes described for queries", descriptions.clone());
        let (textures, revision, running) = (Gauge::default(), Gauge::default(), Gauge::default());
        registry.register("textures", "Textures in the store", textures.clone());
        registry.register("revision", "Number of the last commit of the store", revision.clone());
        registry.register("jobs_running", "Running jobs", running.clone());
        Self { registry, requests, latency, searches, descriptions, textures, revision, running }
    }

    pub(crate) fn count_search(&self, space: &str, index: &str, elapsed: Duration) {
        let labels = SearchLabels { space: space.to_owned(), index: index.to_owned() };
        self.searches.get_or_create(&labels).observe(elapsed.as_secs_f64());
    }

    /// Counts a volume that is described for a query.
    pub(crate) fn count_description(&self) {
        self.descriptions.inc();
    }

    pub(crate) fn count_request(&self, method: &Method, route: &str, status: u16, elapsed: Duration) {
        let labels = RequestLabels { method: method.to_string(), route: route.to_owned(), status };
        self.requests.get_or_create(&labels).inc();
        self.latency.get_or_create(&RouteLabels { route: route.to_owned() }).observe(elapsed.as_secs_f64());
    }

    /// Sets what is read from the store and the jobs when the metrics are asked for.
    pub(crate) fn set_state(&self, textures: u64, revision: u64, running: usize) {
        self.textures.set(textures as i64);
        self.revision.set(revision as i64);
        self.running.set(running as i64);
    }

    /// All metrics in the OpenMetrics text format.
    pub(crate) fn text(&self) -> Result<String, fmt::Error> {
        let mut buffer = String::new();
        text::encode(&mut buffer, &self.registry)?;
        Ok(buffer)
    }
}
