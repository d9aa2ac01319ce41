//! The routes, and the OpenAPI document that is generated from them.

use std::sync::{Arc, OnceLock};

use axum::Router;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use axum::routing::get;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::problem::{Problem, ProblemDocument};
use super::reply::{self, CachePolicy};
use super::routes::{jobs, metrics, pictures, query, store, textures, voxels};
use super::state::App;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "hlacdb",
        description = "Finds solid textures that look alike. Ids are numbers; shapes are (Z, Y, X). Errors are problem+json \
                       (RFC 9457): `detail` is one sentence, `causes` lists its causes."
    ),
    tags(
        (name = "textures", description = "List, add, tag and remove textures"),
        (name = "pictures", description = "Slices and voxels of textures"),
        (name = "likeness", description = "Queries, distances and the map"),
        (name = "store", description = "The store as a whole"),
        (name = "jobs", description = "Long work with progress"),
        (name = "server", description = "The server itself")
    ),
    components(schemas(ProblemDocument))
)]
struct Description;

fn documented_routes() -> OpenApiRouter<Arc<App>> {
    let api = OpenApiRouter::new()
        .routes(routes!(store::health))
        .routes(routes!(store::formats))
        .routes(routes!(store::statistics))
        .routes(routes!(store::spaces))
        .routes(routes!(store::tags))
        .routes(routes!(store::map))
        .routes(routes!(store::explain))
        .routes(routes!(textures::list, textures::add))
        .routes(routes!(textures::get, textures::remove))
        .routes(routes!(textures::descriptor))
        .routes(routes!(textures::set_tags))
        .routes(routes!(textures::unset_tag))
        .routes(routes!(pictures::slices))
        .routes(routes!(pictures::slice))
        .routes(routes!(pictures::thumbnail))
        .routes(routes!(voxels::voxels))
        .routes(routes!(pictures::upload_slices))
        .routes(routes!(pictures::upload_slice))
        .routes(routes!(pictures::upload_thumbnail))
        .routes(routes!(voxels::upload_voxels))
        .routes(routes!(query::query))
        .routes(routes!(jobs::reindex))
        .routes(routes!(jobs::ingest))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::get, jobs::cancel))
        .routes(routes!(jobs::events));
    OpenApiRouter::with_openapi(Description::openapi()).nest("/api/v1", api).routes(routes!(metrics::metrics))
}

/// Every route of the API.
pub(crate) fn routes() -> Router<Arc<App>> {
    let (router, _) = documented_routes().split_for_parts();
    router.route("/api/v1/openapi.json", get(document))
}

/// The OpenAPI document.
async fn document(State(_): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Problem> {
    static DOCUMENT: OnceLock<Vec<u8>> = OnceLock::new();
    let bytes = DOCUMENT.get_or_init(|| {
        let (_, description) = documented_routes().split_for_parts();
        description.to_json().unwrap_or_default().into_bytes()
    });
    reply::tagged(&headers, &reply::entity_tag(&[bytes]), CachePolicy::Revalidate, reply::JSON, || {
        Ok(bytes.as_slice().into())
    })
}
