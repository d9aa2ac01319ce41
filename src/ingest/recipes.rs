//! A recipe's textures as files.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use rayon::prelude::*;

use crate::arrays;
use crate::error::Error;
use crate::ingest::Report;
use crate::progress::Progress;
use crate::synth::{Recipe, Specimen};

/// The kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// numpy, `u8`, (Z, Y, X).
    Npy,
    /// Bare bytes, X fastest.
    Raw,
}

/// Writes every texture of a recipe to `folder` (made where there is none), and `textures.csv` with name, file and
/// tags. A file that is there already is written anew.
///
/// # Errors
/// [`Error::Io`]. Where `progress` cancels, the files written so far stay and the report says so.
pub fn write_files(recipe: &Recipe, folder: &Path, format: Format, progress: &dyn Progress) -> Result<Report, Error> {
    fs::create_dir_all(folder).map_err(|source| Error::file("making the folder", folder, source))?;
    let specimens = recipe.specimens();
    progress.begin("synthesising", Some(specimens.len() as u64));
    let written: Vec<bool> = specimens
        .par_iter()
        .map(|specimen| {
            if progress.cancelled() {
                return Ok(false);
            }
            write_file(specimen, folder, format)?;
            progress.advance(1);
            Ok(true)
        })
        .collect::<Result<_, Error>>()?;
    write_index(&specimens, folder, format)?;
    let added = written.iter().filter(|written| **written).count() as u64;
    Ok(Report { added, cancelled: progress.cancelled(), ..Report::default() })
}

fn file_name(specimen: &Specimen, format: Format) -> String {
    match format {
        Format::Npy => format!("{}.npy", specimen.name),
        Format::Raw => format!("{}.raw", specimen.name),
    }
}

fn write_file(specimen: &Specimen, folder: &Path, format: Format) -> Result<(), Error> {
    let path = folder.join(file_name(specimen, format));
    let volume = specimen.volume();
    match format {
        Format::Npy => arrays::write_volume(&path, &volume),
        Format::Raw => fs::write(&path, volume.voxels()).map_err(|source| Error::file("writing", &path, source)),
    }
}

fn write_index(specimens: &[Specimen], folder: &Path, format: Format) -> Result<(), Error> {
    let path = folder.join("textures.csv");
    let failed = |error: csv::Error| Error::file("writing", &path, std::io::Error::other(error));
    let keys: BTreeSet<&String> = specimens.iter().flat_map(|specimen| specimen.tags.keys()).collect();
    let mut table = csv::Writer::from_path(&path).map_err(failed)?;
    let heading = ["name", "file"].into_iter().chain(keys.iter().map(|key| key.as_str()));
    table.write_record(heading).map_err(failed)?;
    for specimen in specimens {
        let mut cells = vec![specimen.name.clone(), file_name(specimen, format)];
        cells.extend(keys.iter().map(|key| specimen.tags.get(*key).cloned().unwrap_or_default()));
        table.write_record(&cells).map_err(failed)?;
    }
    table.flush().map_err(|source| Error::file("writing", &path, source))
}
