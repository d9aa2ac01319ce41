//! The HTTP status of every error.

use axum::http::StatusCode;

use crate::store::OpenError;
use crate::{Error, ExchangeError, IngestError, MaintenanceError, QueryError, StoreError};

/// 422 for what the client sent, 404 for what does not exist, 403 for what is not allowed, 409 and 503 for the state of the
/// store, 500 for failures of the server.
///
/// No match here has a wildcard: a new error is given its status before the server compiles.
pub(crate) fn status_of(error: &Error) -> StatusCode {
    match error {
        Error::Open(error) => of_open(error),
        Error::Query(error) => of_query(error),
        Error::Ingest(error) => of_ingest(error),
        Error::Exchange(error) => of_exchange(error),
        Error::Maintenance(error) => of_maintenance(error),
        Error::Store(error) => of_store(error),
        Error::Cancelled => StatusCode::CONFLICT,
        Error::Space(_) | Error::Io { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

fn of_open(error: &OpenError) -> StatusCode {
    match error {
        OpenError::HeldByWriter { .. } => StatusCode::SERVICE_UNAVAILABLE,
        OpenError::NoStore { .. }
        | OpenError::NotAStore { .. }
        | OpenError::Exists { .. }
        | OpenError::Newer { .. }
        | OpenError::UnknownFeatures { .. }
        | OpenError::NeedsMigration { .. }
        | OpenError::NeedsRepair { .. }
        | OpenError::NoLocks { .. }
        | OpenError::DamagedFile { .. }
        | OpenError::Io { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

fn of_query(error: &QueryError) -> StatusCode {
    match error {
        QueryError::TooFewLabels { .. } => StatusCode::NOT_FOUND,
        QueryError::ZeroK
        | QueryError::NoExample
        | QueryError::Distance { .. }
        | QueryError::NoSuchSpace { .. }
        | QueryError::MissingViews { .. }
        | QueryError::SingleLabel { .. }
        | QueryError::UniqueLabels { .. }
        | QueryError::Index(_) => StatusCode::UNPROCESSABLE_ENTITY,
    }
}

fn of_ingest(error: &IngestError) -> StatusCode {
    match error {
        IngestError::NotFound { .. } => StatusCode::NOT_FOUND,
        IngestError::OutsideFolder { .. } => StatusCode::FORBIDDEN,
        IngestError::Read(_) | IngestError::Volume(_) | IngestError::Recipe(_) | IngestError::BlockTooLarge { .. } => {
            StatusCode::UNPROCESSABLE_ENTITY
        }
    }
}

fn of_exchange(error: &ExchangeError) -> StatusCode {
    match error {
        ExchangeError::Array { .. } | ExchangeError::Views { .. } | ExchangeError::Archive { .. } => {
            StatusCode::UNPROCESSABLE_ENTITY
        }
    }
}

fn of_maintenance(error: &MaintenanceError) -> StatusCode {
    match error {
        // The server migrates no store: whatever is wrong is not the client's doing.
        MaintenanceError::Migration(_)
        | MaintenanceError::BeyondRepair { .. }
        | MaintenanceError::NoVoxels
        | MaintenanceError::SpaceExists { .. }
        | MaintenanceError::NotUserDefined { .. }
        | MaintenanceError::ViewsNotStored { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

fn of_store(error: &StoreError) -> StatusCode {
    match error {
        StoreError::Open(error) => of_open(error),
        StoreError::NoSuchTexture { .. } => StatusCode::NOT_FOUND,
        StoreError::ReadOnly => StatusCode::FORBIDDEN,
        StoreError::Invalid { .. } => StatusCode::UNPROCESSABLE_ENTITY,
        StoreError::Duplicate { .. } => StatusCode::CONFLICT,
        StoreError::Busy { .. } => StatusCode::SERVICE_UNAVAILABLE,
        StoreError::Damage(_)
        | StoreError::Broken
        | StoreError::Poisoned
        | StoreError::Cancelled { .. }
        | StoreError::Engine { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::io;
    use std::path::PathBuf;

    use axum::response::IntoResponse;

    use super::*;
    use crate::ExampleKind;
    use crate::hlac::View;
    use crate::index::IndexError;
    use crate::migrations::MigrationError;
    use crate::serve::paths::Roots;
    use crate::serve::problem::Problem;
    use crate::space::SpaceError;
    use crate::store::Damage;
    use crate::synth::RecipeError;
    use crate::volume::{ReadError, VolumeError};

    /// The folder of every path below; no response may name it.
    const SECRET: &str = "/secret/machine";

    fn path() -> PathBuf {
        PathBuf::from(SECRET).join("cores/a.npy")
    }

    fn io_error() -> io::Error {
        io::ErrorKind::PermissionDenied.into()
    }

    fn damage() -> Damage {
        Damage { table: "voxels", key: crate::store::DamageKey::Texture(7), what: "the checksum differs".into() }
    }

    fn open_errors() -> Vec<(OpenError, u16)> {
        vec![
            (OpenError::NoStore { path: path() }, 500),
            (OpenError::NotAStore { path: path(), found: "a picture".into() }, 500),
            (OpenError::Exists { path: path() }, 500),
            (OpenError::Io { doing: "opening", path: path(), source: io_error() }, 500),
            (OpenError::Newer { path: path(), found: 9, supported: 1 }, 500),
            (OpenError::UnknownFeatures { path: path(), unknown: 4 }, 500),
            (OpenError::NeedsMigration { path: path(), found: 0, current: 1 }, 500),
            (OpenError::HeldByWriter { path: path(), owner: Some(1) }, 503),
            (OpenError::NeedsRepair { path: path() }, 500),
            (OpenError::NoLocks { path: path() }, 500),
            (OpenError::DamagedFile { path: path(), damage: damage() }, 500),
        ]
    }

    fn query_errors() -> Vec<(QueryError, u16)> {
        let key = || "rock".to_owned();
        let needs = vec![View::Full];
        vec![
            (QueryError::ZeroK, 422),
            (QueryError::NoExample, 422),
            (QueryError::Distance { found: -1.0 }, 422),
            (QueryError::NoSuchSpace { name: "hyper".into(), spaces: vec!["default".into()] }, 422),
            (QueryError::MissingViews { space: "default".into(), needs, example: ExampleKind::Volume }, 422),
            (QueryError::TooFewLabels { key: key() }, 404),
            (QueryError::SingleLabel { key: key(), value: "ketton".into(), textures: 2 }, 422),
            (QueryError::UniqueLabels { key: key(), textures: 2 }, 422),
            (QueryError::Index(IndexError::ZeroNeighbours), 422),
        ]
    }

    fn ingest_errors() -> Vec<(IngestError, u16)> {
        let too_small = || VolumeError::TooSmall { shape: [2, 2, 2] };
        vec![
            (IngestError::Read(ReadError::new(path(), too_small())), 422),
            (IngestError::Volume(too_small()), 422),
            (IngestError::Recipe(RecipeError::DuplicateName { name: "a".into() }), 422),
            (IngestError::BlockTooLarge { path: path(), shape: [8; 3], side: 9 }, 422),
            (IngestError::OutsideFolder { path: path() }, 403),
            (IngestError::NotFound { path: path(), source: io_error() }, 404),
        ]
    }

    fn exchange_errors() -> Vec<(ExchangeError, u16)> {
        let (found, stored) = (vec![View::Full], vec![View::Detail]);
        vec![
            (ExchangeError::Array { path: path(), found: "(3,)".into(), expected: "(N, 251)".into() }, 422),
            (ExchangeError::Views { path: path(), found, stored }, 422),
            (ExchangeError::Archive { path: path(), what: "the list is empty".into() }, 422),
        ]
    }

    fn maintenance_errors() -> Vec<(MaintenanceError, u16)> {
        let lost = StoreError::Open(OpenError::DamagedFile { path: path(), damage: damage() });
        vec![
            (MaintenanceError::BeyondRepair { path: path(), source: lost }, 500),
            (MaintenanceError::Migration(MigrationError::NotAStore { path: path() }), 500),
            (MaintenanceError::NoVoxels, 500),
            (MaintenanceError::SpaceExists { name: "mine".into() }, 500),
            (MaintenanceError::NotUserDefined { name: "paper".into(), user_defined: vec![] }, 500),
            (MaintenanceError::ViewsNotStored { space: "mine".into(), needs: vec![View::Full] }, 500),
        ]
    }

    fn store_errors() -> Vec<(StoreError, u16)> {
        vec![
            (StoreError::Open(OpenError::NoLocks { path: path() }), 500),
            (StoreError::ReadOnly, 403),
            (StoreError::Busy { doing: "compacting" }, 503),
            (StoreError::Damage(damage()), 500),
            (StoreError::NoSuchTexture { id: 7 }, 404),
            (StoreError::Duplicate { id: 7 }, 409),
            (StoreError::Invalid { what: "a tag needs a key".into() }, 422),
            (StoreError::Broken, 500),
            (StoreError::Poisoned, 500),
            (StoreError::Cancelled { doing: "compacting" }, 500),
            (StoreError::Engine { doing: "reading", source: io_error().into() }, 500),
        ]
    }

    /// One error of every variant of every family, with its HTTP status.
    fn every_error() -> Vec<(Error, u16)> {
        let mut errors = vec![
            (Error::Space(SpaceError::NoViews), 500),
            (Error::file("reading", &path(), io_error()), 500),
            (Error::Cancelled, 409),
        ];
        errors.extend(open_errors().into_iter().map(|(error, status)| (Error::Open(error), status)));
        errors.extend(query_errors().into_iter().map(|(error, status)| (Error::Query(error), status)));
        errors.extend(ingest_errors().into_iter().map(|(error, status)| (Error::Ingest(error), status)));
        errors.extend(exchange_errors().into_iter().map(|(error, status)| (Error::Exchange(error), status)));
        errors.extend(maintenance_errors().into_iter().map(|(error, status)| (Error::Maintenance(error), status)));
        errors.extend(store_errors().into_iter().map(|(error, status)| (Error::Store(error), status)));
        errors
    }

    /// The names of the variants of an enum, from its source.
    fn variants(source: &str, name: &str) -> BTreeSet<String> {
        let body = source.split_once(&format!("pub enum {name} {{")).unwrap().1.split_once("\n}").unwrap().0;
        let lines = body.lines().filter_map(|line| line.strip_prefix("    "));
        let names = lines.filter(|line| line.starts_with(|first: char| first.is_ascii_uppercase()));
        names.map(|line| line.split(|letter: char| !letter.is_alphanumeric()).next().unwrap().to_owned()).collect()
    }

    /// The names of the variants of these errors.
    fn listed<E: std::fmt::Debug>(errors: &[(E, u16)]) -> BTreeSet<String> {
        let name =
            |error: &E| format!("{error:?}").split(|letter: char| !letter.is_alphanumeric()).next().map(str::to_owned);
        errors.iter().filter_map(|(error, _)| name(error)).collect()
    }

    #[test]
    fn every_error_has_its_status() {
        assert_eq!(listed(&every_error()), variants(include_str!("../error/mod.rs"), "Error"));
        assert_eq!(listed(&open_errors()), variants(include_str!("../store/open_error.rs"), "OpenError"));
        assert_eq!(listed(&query_errors()), variants(include_str!("../error/query.rs"), "QueryError"));
        assert_eq!(listed(&ingest_errors()), variants(include_str!("../error/ingest.rs"), "IngestError"));
        assert_eq!(listed(&exchange_errors()), variants(include_str!("../error/exchange.rs"), "ExchangeError"));
        assert_eq!(
            listed(&maintenance_errors()),
            variants(include_str!("../error/maintenance.rs"), "MaintenanceError")
        );
        assert_eq!(listed(&store_errors()), variants(include_str!("../store/error.rs"), "StoreError"));
        for (error, status) in every_error() {
            assert_eq!(status_of(&error).as_u16(), status, "{error}");
        }
    }

    async fn body(problem: Problem) -> String {
        let body = axum::body::to_bytes(problem.into_response().into_body(), usize::MAX).await.unwrap();
        String::from_utf8(body.to_vec()).unwrap()
    }

    #[tokio::test]
    async fn no_response_names_a_folder_of_the_machine() {
        let roots = Roots::new([PathBuf::from(SECRET)]);
        let mut with_a_path = BTreeSet::new();
        for ((error, _), (same, _)) in every_error().into_iter().zip(every_error()) {
            let text = crate::chain(&error);
            let family = listed(&[(&error, 0)]).pop_first();
            let unrooted = body(error.into()).await;
            let rooted = body(Problem::from(same).relative_to(&roots)).await;
            assert!(!unrooted.contains(SECRET) && !rooted.contains(SECRET), "{unrooted} {rooted}");
            if text.contains(SECRET) {
                with_a_path.extend(family);
                assert!(rooted.contains("cores/a.npy"), "relative to the folder that is served: {rooted}");
                assert!(unrooted.contains("a.npy") && !unrooted.contains("cores/"), "the bare name: {unrooted}");
            }
        }
        assert!(with_a_path.iter().eq(["Exchange", "Ingest", "Io", "Maintenance", "Open", "Store"]), "{with_a_path:?}");
    }
}
