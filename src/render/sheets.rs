//! Contact sheets of what a database holds and finds.

use super::Image;
use super::contact_sheet::{ContactSheetOptions, Panel, contact_sheet, single_sheet};
use crate::database::{Answer, Database, Texture};
use crate::error::Error;
use crate::volume::Volume;

/// The sheet of one texture: its slices above its name, id, tags and shape, and which slices are shown at which scale.
pub fn texture_sheet(texture: &Texture, volume: &Volume, options: &ContactSheetOptions) -> Image {
    let tags: Vec<String> = texture.tags.iter().map(|(key, value)| format!("{key}={value}")).collect();
    let caption = vec![texture.name.clone(), format!("id {}", texture.id), tags.join(" ")];
    single_sheet(&Panel { volume, caption }, options)
}

/// The sheet of an answer: the query first, then the hits whose voxels are stored (the paper's Figure 6).
///
/// `query` is the volume that was asked with, where it is known, and `name` what it is called. Title and captions are set
/// here; the other options are the caller's. `None` where neither the query nor a hit has voxels.
///
/// # Errors
/// Those of [`Database::volume`].
pub fn answer_sheet(
    database: &Database,
    query: Option<&Volume>,
    name: &str,
    answer: &Answer,
    options: &ContactSheetOptions,
) -> Result<Option<Image>, Error> {
    let mut volumes = Vec::with_capacity(answer.hits.len());
    for hit in &answer.hits {
        if let Some(volume) = database.volume(hit.id)? {
            volumes.push((hit, volume));
        }
    }
    let query = query.map(|volume| Panel { volume, caption: vec![name.to_owned(), "the query".into()] });
    let hits = volumes.iter().map(|(hit, volume)| {
        let distance = format!("id {}  distance {:.4}", hit.id, hit.distance);
        Panel { volume, caption: vec![format!("{}. {}", hit.rank, hit.name), distance] }
    });
    let options =
        options.clone().title(format!("Nearest to {name}, space {}", answer.space)).query_first(query.is_some());
    let panels: Vec<Panel<'_>> = query.into_iter().chain(hits).collect();
    Ok((!panels.is_empty()).then(|| contact_sheet(&panels, &options)))
}
