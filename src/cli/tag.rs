//! `hlacdb tag`, and how `KEY=VALUE` is read everywhere.

use std::collections::BTreeMap;
use std::str::FromStr;

use clap::Args;

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
    pub(crate) fn into_pair(self) -> (String, String) {
        (self.key, self.value)
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

/// Set or take off tags of a texture
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb tag 12 family=marble site=Carrara
  hlacdb tag 12 --unset site")]
pub(crate) struct Tag {
    /// The texture
    #[arg(value_parser = whole::<u64>)]
    id: u64,

    /// Tags to set; a key holds one value, a new one replaces the old
    #[arg(value_name = "KEY=VALUE", required_unless_present = "unset")]
    tags: Vec<KeyValue>,

    /// Keys to take off
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
}

impl Tag {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let set: Vec<(String, String)> = one_value_each(self.tags)?.into_iter().collect();
        let database = context.open_to_write()?;
        let texture = database.tag(self.id, &set, &self.unset)?;
        if context.json {
            context.print_json(&serde_json::json!({ "id": texture.id, "tags": texture.tags }))?;
        } else {
            let line = format!("{} {}: {}", texture.id, texture.name, super::table::tags(&texture.tags));
            context.note(&one_line(&line));
        }
        Ok(Outcome::Done)
    }
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
    fn a_value_may_hold_an_equals_sign_but_no_side_may_be_empty() {
        assert_eq!("a=b=c".parse::<KeyValue>().unwrap().into_pair(), ("a".to_owned(), "b=c".to_owned()));
        for bad in ["a", "=b", "a=", ""] {
            assert!(bad.parse::<KeyValue>().is_err(), "{bad}");
        }
    }
}
