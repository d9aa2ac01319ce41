//! Exporting and importing moments and points as arrays.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::TextureId;
use crate::database::exchange::arrays::{MomentRows, NpyRows};
use crate::database::handle::Database;
use crate::database::points::stored::BlockMoments;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::{Error, ExchangeError};
use crate::hlac::{MASK_COUNT, View};
use crate::progress::Progress;
use crate::space::FeatureSet;
use crate::store::{DESCRIPTOR_ROWS, NewTexture, Reads, ViewCode};
use crate::volume::display_path;

/// What [`Database::export`] wrote.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExportReport {
    /// The number of rows of each file.
    pub textures: u64,
    /// The paths of the files.
    pub files: Vec<String>,
}

/// What [`Database::import`] added.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImportReport {
    /// The number of textures that were added.
    pub added: u64,
    /// The first and the last id; `None` if no texture was added.
    pub ids: Option<(TextureId, TextureId)>,
}

/// The number of rows that are added in one transaction.
const IMPORT_ROWS: usize = 16 * 1024;

impl Database {
    /// Writes moments and points to files in `folder`, which is created if there is none. Rows are in id order, and the same in
    /// all files:
    ///
    /// | file | shape | content |
    /// |---|---|---|
    /// | `moments.npy` | (N, 251) | `f32` moments of `full@1`; NaN if the texture has none |
    /// | `points.npy` | (N, P) | `f32` points in the default space; NaN if the texture has none |
    /// | `textures.csv` | | row, id, name, shape, path and a column per tag |
    /// | `graph.npy` | (N, K) | with `graph`: `i64` ids of the K nearest neighbours in the default space, nearest first, ties by id, without the texture itself; -1 if there are fewer |
    /// | `graph_distances.npy` | (N, K) | with `graph`: their `f64` distances; NaN if there are fewer |
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Store`], [`Error::Cancelled`].
    pub fn export(&self, folder: &Path, graph: Option<usize>, progress: &dyn Progress) -> Result<ExportReport, Error> {
        let created = std::fs::create_dir_all(folder);
        created.map_err(|source| Error::file("creating the folder", folder, source))?;
        let snapshot = self.store().read()?;
        let state = self.state(&snapshot, DEFAULT_SPACE)?;
        let rows = snapshot.rows()?;
        let live: Vec<(usize, u64)> = rows.live().collect();
        progress.begin("exporting", Some(live.len() as u64));

        let feature_set = FeatureSet::plain();
        let mut moments = NpyRows::create(&folder.join("moments.npy"), &[live.len(), MASK_COUNT])?;
        let mut points = NpyRows::create(&folder.join("points.npy"), &[live.len(), state.owner.space.dims()])?;
        let no_point = vec![f32::NAN; state.owner.space.dims()];
        let mut block = None;
        for &(row, id) in &live {
            let number = (row / DESCRIPTOR_ROWS) as u32;
            if block.as_ref().is_none_or(|(at, _)| *at != number) {
                if progress.cancelled() {
                    return Err(Error::Cancelled);
                }
                block = Some((number, BlockMoments::read(&snapshot, &feature_set, number)?));
            }
            let stored = block.as_ref().and_then(|(_, block)| block.row(View::Full, row % DESCRIPTOR_ROWS));
            moments.push(stored.unwrap_or(&[f32::NAN; MASK_COUNT]))?;
            points.push(state.index.points().point(id).unwrap_or(&no_point))?;
            progress.advance(1);
        }
        moments.finish()?;
        points.finish()?;
        write_table(&snapshot, &folder.join("textures.csv"))?;
        let mut files = vec!["moments.npy", "points.npy", "textures.csv"];
        if let Some(k) = graph {
            files.extend(self.write_graph(folder, k, progress)?);
        }
        let files = files.into_iter().map(|name| display_path(&folder.join(name))).collect();
        Ok(ExportReport { textures: live.len() as u64, files })
    }

    /// Adds textures without voxels from an array of moments, as [`MomentRows`] reads it. `views` are the views of the array,
    /// in the order of its columns, and must be those of the store. `names` is a text file with a name per line; without it,
    /// textures are named by file and row.
    ///
    /// Rows are added in transactions of 16384, so that memory does not grow with the array. If an error occurs or `progress`
    /// cancels, rows that were committed stay.
    ///
    /// # Errors
    /// [`ExchangeError::Array`]; [`Error::Space`] if a value is not a moment; [`ExchangeError::Views`] if the store keeps other
    /// views than those.
    pub fn import(
        &self,
        moments: &Path,
        views: &[View],
        names: Option<&Path>,
        tags: &BTreeMap<String, String>,
        progress: &dyn Progress,
    ) -> Result<ImportReport, Error> {
        let scheme = Scheme::of(&self.store().read()?);
        if scheme.views().len() != views.len() || !scheme.views().iter().all(|view| views.contains(view)) {
            let (path, found, stored) = (moments.to_owned(), views.to_vec(), scheme.views().to_vec());
            return Err(ExchangeError::Views { path, found, stored }.into());
        }
        let mut rows = MomentRows::open_views(moments, views.len())?;
        let stem = moments.file_stem().map_or_else(String::new, |stem| display_path(Path::new(stem)));
        let mut names = Names::open(names, stem)?;
        let codes: Vec<ViewCode> = views.iter().map(|view| ViewCode(view.code())).collect();
        progress.begin("importing", Some(rows.len()));
        let mut report = ImportReport { added: 0, ids: None };
        let batch_rows = (IMPORT_ROWS / views.len().max(1)).max(1);
        while !rows.is_empty() && !progress.cancelled() {
            let mut batch = Vec::with_capacity(batch_rows);
            for row in rows.by_ref().take(batch_rows) {
                let descriptors = codes.iter().copied().zip(row?).collect();
                batch.push(NewTexture {
                    name: names.next()?,
                    tags: tags.clone(),
                    descriptors,
                    ..NewTexture::default()
                });
            }
            let ids = self.add_described(batch)?;
            report.added += ids.len() as u64;
            if let (Some(&first), Some(&last)) = (ids.first(), ids.last()) {
                report.ids = Some((report.ids.map_or(first.into(), |(first, _)| first), last.into()));
            }
            progress.advance(ids.len() as u64);
        }
        if report.added > IMPORT_ROWS as u64 {
            // The file grows by doubling: the empty space at its end is returned. Only a reader of an older state prevents
            // that, and the store can be compacted later.
            if let Err(error) = self.compact(progress) {
                tracing::info!(%error, "the store was not compacted after the import");
            }
        }
        Ok(report)
    }
}

/// The names of imported rows: the lines of a file, or the stem of the array's file with the number of the row.
struct Names {
    lines: Option<(PathBuf, std::io::Lines<BufReader<File>>)>,
    stem: String,
    row: u64,
}

impl Names {
    fn open(path: Option<&Path>, stem: String) -> Result<Self, Error> {
        let lines = match path {
            None => None,
            Some(path) => {
                let file = File::open(path).map_err(|source| Error::file("reading", path, source))?;
                Some((path.to_owned(), BufReader::new(file).lines()))
            }
        };
        Ok(Self { lines, stem, row: 0 })
    }

    fn next(&mut self) -> Result<String, Error> {
        self.row += 1;
        match &mut self.lines {
            None => Ok(format!("{}-{:06}", self.stem, self.row - 1)),
            Some((path, lines)) => match lines.next() {
                Some(Ok(line)) => Ok(line.trim_end().to_owned()),
                Some(Err(source)) => Err(Error::file("reading", path, source)),
                None => Err(ExchangeError::Array {
                    path: path.clone(),
                    found: format!("a list of {} names", self.row - 1),
                    expected: "one name for each row of moments".into(),
                }
                .into()),
            },
        }
    }
}

fn write_table(state: &impl Reads, path: &Path) -> Result<(), Error> {
    let failed = |error: csv::Error| Error::file("writing", path, std::io::Error::other(error));
    let keys: BTreeSet<String> = state.tag_keys()?.into_iter().collect();
    let mut table = csv::Writer::from_path(path).map_err(failed)?;
    let heading = ["row", "id", "name", "shape", "path"].into_iter().map(str::to_owned);
    table.write_record(heading.chain(keys.iter().map(|key| format!("tag:{key}")))).map_err(failed)?;
    for (row, record) in state.records().enumerate() {
        let record = record?;
        let shape = record.content.as_ref().map(|content| content.shape.map(|side| side.to_string()).join("x"));
        let path = record.path().map(|path| display_path(&path));
        let mut cells = vec![row.to_string(), record.id.to_string(), record.name];
        cells.extend([shape.unwrap_or_default(), path.unwrap_or_default()]);
        cells.extend(keys.iter().map(|key| record.tags.get(key).cloned().unwrap_or_default()));
        table.write_record(&cells).map_err(failed)?;
    }
    table.flush().map_err(|source| Error::file("writing", path, source))
}
