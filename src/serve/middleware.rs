//! What happens to every request before and after its route: authentication, limits of size and time, errors as problems,
//! security headers.

use std::sync::Arc;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::auth::{self, Admission};
use super::limits;
use super::problem::Problem;
use super::state::App;

/// The page loads nothing from other sites, and no site may frame it.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; base-uri 'none'; \
                      form-action 'self'; frame-ancestors 'none'";

/// Headers of every response.
const HEADERS: [(HeaderName, &str); 5] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

/// Runs a request through authentication and limits to its route, and completes the response.
pub(crate) async fn handle(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let mut response = match respond(&app, request, next).await {
        Ok(response) => response,
        Err(problem) => problem.into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Counts every request by its route, so that ids do not create time series of their own.
pub(crate) async fn count(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let began = std::time::Instant::now();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().map_or("(page)", MatchedPath::as_str).to_owned();
    let response = next.run(request).await;
    app.metrics.count_request(&method, &route, response.status().as_u16(), began.elapsed());
    response
}

async fn respond(app: &App, request: Request, next: Next) -> Result<Response, Problem> {
    let options = &app.options;
    if let Admission::SetCookie(response) = auth::admit(options.token.as_deref(), &request)? {
        return Ok(response);
    }
    if limits::declares_too_long_body(request.headers(), options.max_body) {
        let _ = tokio::time::timeout(options.time, limits::drain(request)).await;
        return Err(limits::body_too_long(options.max_body));
    }
    match tokio::time::timeout(options.time, next.run(request)).await {
        Ok(response) => Ok(as_problem(app, response).await),
        Err(_) => {
            let detail = format!("the request took longer than {} seconds: ask for less", options.time.as_secs());
            Err(Problem::new(StatusCode::GATEWAY_TIMEOUT, detail))
        }
    }
}

/// Turns error responses of the framework (unknown routes, rejected queries) into problems.
async fn as_problem(app: &App, response: Response) -> Response {
    let status = response.status();
    let kind = response.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if !(status.is_client_error() || status.is_server_error())
        || kind.starts_with("application/problem+json")
        || status == StatusCode::RANGE_NOT_SATISFIABLE
    {
        return response;
    }
    let (parts, body) = response.into_parts();
    let text = axum::body::to_bytes(body, 4096).await.unwrap_or_default();
    let text = String::from_utf8_lossy(&text).trim().to_owned();
    let problem = match status {
        StatusCode::NOT_FOUND => {
            Problem::not_found("there is no such address: /api/v1/openapi.json lists all routes of the API")
        }
        StatusCode::METHOD_NOT_ALLOWED => {
            let detail = "this address does not support the method: /api/v1/openapi.json lists all routes of the API";
            Problem::new(status, detail)
        }
        StatusCode::PAYLOAD_TOO_LARGE => limits::body_too_long(app.options.max_body),
        _ if text.is_empty() => Problem::new(status, "the request cannot be answered"),
        _ => Problem::new(status, text),
    };
    let mut response = problem.into_response();
    if let Some(allow) = parts.headers.get(header::ALLOW) {
        response.headers_mut().insert(header::ALLOW, allow.clone());
    }
    response
}
