//! `hlacdb tag`.

use clap::Args;
use hlacdb::TagEdit;

use crate::cli::arguments::{KeyValue, tag_map, whole};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{self, one_line};

/// Set or remove tags of textures
///
/// A key has one value: a new value replaces the old one.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb tag 12 family=marble site=Carrara
  hlacdb tag 73 74 75 rock=ketton
  hlacdb tag 12 --unset site")]
pub(crate) struct Tag {
    /// The ids of textures, then the tags to set
    #[arg(value_name = "ID... KEY=VALUE", required = true, num_args = 1..)]
    words: Vec<String>,

    /// A key to remove (repeatable)
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
}

impl Tag {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let (ids, tags) = ids_and_tags(&self.words)?;
        if tags.is_empty() && self.unset.is_empty() {
            return Err(Failure::Usage("no tag to set or remove: give KEY=VALUE, or --unset KEY".into()));
        }
        let set = tag_map(tags)?.into_iter().fold(TagEdit::new(), |edit, (key, value)| edit.set(key, value));
        let edit = self.unset.iter().fold(set, TagEdit::unset);
        let database = context.open_to_write()?;
        // If one of the ids is not in the store, nothing is changed.
        ids.iter().try_for_each(|&id| database.texture(id).map(drop))?;
        let mut changed = Vec::with_capacity(ids.len());
        for id in ids {
            let texture = database.tag(id, &edit)?;
            let line = format!("{} {}: {}", texture.id, texture.name, table::tags(&texture.tags));
            changed.push(serde_json::json!({ "id": texture.id, "tags": texture.tags }));
            if !context.json {
                context.note(&one_line(&line));
            }
        }
        match (context.json, &changed[..]) {
            (false, _) => {}
            (true, [one]) => context.print_json(one)?,
            (true, all) => context.print_json(&serde_json::json!({ "textures": all }))?,
        }
        Ok(Outcome::Done)
    }
}

/// Splits `ID... KEY=VALUE...`.
fn ids_and_tags(words: &[String]) -> Result<(Vec<u64>, Vec<KeyValue>), Failure> {
    let ids = words.iter().take_while(|word| !word.contains('=')).count();
    let (ids, tags) = words.split_at(ids);
    let ids: Vec<u64> = ids.iter().map(|word| whole(word)).collect::<Result<_, String>>().map_err(Failure::Usage)?;
    if ids.is_empty() {
        return Err(Failure::Usage("no texture is given: ids come first, then tags".into()));
    }
    Ok((ids, tags.iter().map(|word| word.parse()).collect::<Result<_, String>>().map_err(Failure::Usage)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_come_first() {
        let split = |words: &[&str]| ids_and_tags(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>());
        let (ids, tags) = split(&["7", "8", "a=1", "b=2"]).unwrap();
        assert_eq!((ids, tags.len()), (vec![7, 8], 2));
        for bad in [&["a=1"][..], &["7", "x", "a=1"], &["7", "a=1", "8"]] {
            assert!(matches!(split(bad), Err(Failure::Usage(_))), "{bad:?}");
        }
    }
}
