//! The textures of a recipe as files.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use rayon::prelude::*;

use super::report::IngestReport;
use crate::database::arrays;
use crate::error::Error;
use crate::progress::Progress;
use crate::synth::{Recipe, Specimen};

/// The format of the files that [`write_recipe_files`] writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SpecimenFormat {
    /// NumPy arrays of `u8`, (Z, Y, X).
    Npy,
    /// Voxels of one byte without a header, X fastest.
    Raw,
}

/// Writes every texture of a recipe as a file to `folder`, which is created if there is none, and `textures.csv` with the
/// name, file and tags of each. Existing files are overwritten. If `progress` cancels, the files written so far stay, and
/// the report says so.
///
/// # Errors
/// [`Error::Io`].
pub fn write_recipe_files(
    recipe: &Recipe,
    folder: &Path,
    format: SpecimenFormat,
    progress: &dyn Progress,
) -> Result<IngestReport, Error> {
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
    Ok(IngestReport { added, cancelled: progress.cancelled(), ..IngestReport::default() })
}

fn file_name(specimen: &Specimen, format: SpecimenFormat) -> String {
    match format {
        SpecimenFormat::Npy => format!("{}.npy", specimen.name),
        SpecimenFormat::Raw => format!("{}.raw", specimen.name),
    }
}

fn write_file(specimen: &Specimen, folder: &Path, format: SpecimenFormat) -> Result<(), Error> {
    let path = folder.join(file_name(specimen, format));
    let volume = specimen.volume();
    match format {
        SpecimenFormat::Npy => arrays::write_volume(&path, &volume),
        SpecimenFormat::Raw => {
            fs::write(&path, volume.voxels()).map_err(|source| Error::file("writing", &path, source))
        }
    }
}

fn write_index(specimens: &[Specimen], folder: &Path, format: SpecimenFormat) -> Result<(), Error> {
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
