//! `hlacdb tag`, and how `KEY=VALUE` is read everywhere.

use std::collections::BTreeMap;
use std::str::FromStr;

use clap::Args;
use hlacdb::{TagEdit, TagFilter};

use super::table::one_line;
use super::values::whole;
use super::{Context, Failure, Outcome};

/// `KEY=VALUE` on the command line: split at the first `=`, neither side empty.
#[derive(Clone, Debug)]
pub(crate) struct KeyValue {
    key: String,
    value: String,
}

impl KeyValue {
    /// The textures that have this tag.
    pub(crate) fn into_filter(self) -> TagFilter {
        TagFilter::equals(self.key, self.value)
    }
}

/// The tags that are to be given; a key holds one value.
pub(crate) fn one_value_each(pairs: Vec<KeyValue>) -> Result<BTreeMap<String, String>, Failure> {
    let mut tags = BTreeMap::new();
    for KeyValue { key, value } in pairs {
        match tags.get(&key) {
            Some(other) if *other != value => {
                let sentence =
                    format!("the tag '{key}' is given two values, '{other}' and '{value}', but it holds one");
                return Err(Failure::Usage(sentence));
            }
            _ => tags.insert(key, value),
        };
    }
    Ok(tags)
}

impl FromStr for KeyValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((key, value)) if !key.is_empty() && !value.is_empty() => {
                Ok(Self { key: key.to_owned(), value: value.to_owned() })
            }
            _ => Err(format!("'{text}' is not KEY=VALUE")),
        }
    }
}

/// Set or take off tags of textures
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb tag 12 family=marble site=Carrara
  hlacdb tag 73 74 75 rock=ketton
  hlacdb tag 12 --unset site")]
pub(crate) struct Tag {
    /// Textures by their ids, and then the tags to set; a key holds one value, a new one replaces the old
    #[arg(value_name = "ID... KEY=VALUE", required = true, num_args = 1..)]
    words: Vec<String>,

    /// Keys to take off
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
}

impl Tag {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let (ids, tags) = ids_and_tags(&self.words)?;
        if tags.is_empty() && self.unset.is_empty() {
            return Err(Failure::Usage("nothing to set or take off: name a KEY=VALUE, or --unset KEY".into()));
        }
        let set = one_value_each(tags)?.into_iter().fold(TagEdit::new(), |edit, (key, value)| edit.set(key, value));
        let edit = self.unset.iter().fold(set, TagEdit::unset);
        let database = context.open_to_write()?;
        // All of them or none: an id that is not there changes nothing.
        ids.iter().try_for_each(|&id| database.texture(id).map(drop))?;
        let mut changed = Vec::with_capacity(ids.len());
        for id in ids {
            let texture = database.tag(id, &edit)?;
            let line = format!("{} {}: {}", texture.id, texture.name, super::table::tags(&texture.tags));
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
        return Err(Failure::Usage("no texture is named: ids come first, tags after them".into()));
    }
    Ok((ids, tags.iter().map(|word| word.parse()).collect::<Result<_, String>>().map_err(Failure::Usage)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_holds_one_value() {
        let given = |pairs: &[&str]| one_value_each(pairs.iter().map(|pair| pair.parse().unwrap()).collect());
        assert_eq!(given(&["a=1", "b=2", "a=1"]).unwrap().len(), 2);
        assert!(matches!(given(&["a=1", "a=2"]), Err(Failure::Usage(_))));
    }

    #[test]
    fn ids_come_first() {
        let split = |words: &[&str]| ids_and_tags(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>());
        let (ids, tags) = split(&["7", "8", "a=1", "b=2"]).unwrap();
        assert_eq!((ids, tags.len()), (vec![7, 8], 2));
        for bad in [&["a=1"][..], &["7", "x", "a=1"], &["7", "a=1", "8"]] {
            assert!(matches!(split(bad), Err(Failure::Usage(_))), "{bad:?}");
        }
    }

    #[test]
    fn a_value_may_hold_an_equals_sign_but_no_side_may_be_empty() {
        let pair = "a=b=c".parse::<KeyValue>().unwrap();
        assert_eq!((pair.key.as_str(), pair.value.as_str()), ("a", "b=c"));
        for bad in ["a", "=b", "a=", ""] {
            assert!(bad.parse::<KeyValue>().is_err(), "{bad}");
        }
    }
}
