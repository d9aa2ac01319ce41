//! The imports of a module, and the paths that its code mentions.

use std::collections::BTreeSet;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, Visibility};

use super::{Import, Names, attributes, leaves, only_for_tests};

#[derive(Default)]
pub(super) struct Found {
    pub(super) imports: Vec<Import>,
    pub(super) mentions: BTreeSet<Names>,
}

/// Looks through items, but not into nested modules, which are modules of their own.
pub(super) fn find(items: &[Item]) -> Found {
    let mut found = Found::default();
    items.iter().for_each(|item| found.visit_item(item));
    found
}

impl Found {
    /// Paths of two names or more in the tokens of a macro or an attribute.
    fn scan(&mut self, tokens: TokenStream) {
        let mut path: Names = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == ':' && !path.is_empty() => colons += 1,
                TokenTree::Ident(ident) if colons == 2 => {
                    path.push(ident.to_string());
                    colons = 0;
                }
                other => {
                    self.mention(std::mem::take(&mut path));
                    colons = 0;
                    match other {
                        TokenTree::Ident(ident) => path.push(ident.to_string()),
                        TokenTree::Group(group) => self.scan(group.stream()),
                        _ => {}
                    }
                }
            }
        }
        self.mention(path);
    }

    fn mention(&mut self, path: Names) {
        if path.len() > 1 {
            self.mentions.insert(path);
        }
    }
}

impl<'ast> Visit<'ast> for Found {
    fn visit_item(&mut self, item: &'ast Item) {
        if !matches!(item, Item::Mod(_)) && !attributes(item).iter().any(only_for_tests) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast syn::ImplItem) {
        let attributes = match item {
            syn::ImplItem::Fn(item) => &item.attrs,
            syn::ImplItem::Const(item) => &item.attrs,
            _ => &Vec::new(),
        };
        if !attributes.iter().any(only_for_tests) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let prefix: Names = item.leading_colon.iter().map(|_| String::new()).collect();
        let mut found = Vec::new();
        leaves(&item.tree, &prefix, &mut found);
        self.imports.extend(found.into_iter().map(|(path, name)| Import {
            path,
            name,
            exported: !matches!(item.vis, Visibility::Inherited),
            public: matches!(item.vis, Visibility::Public(_)),
            attributes: item.attrs.clone(),
        }));
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let leading = path.leading_colon.iter().map(|_| String::new());
        self.mentions.insert(leading.chain(path.segments.iter().map(|segment| segment.ident.to_string())).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_path(&call.path);
        self.scan(call.tokens.clone());
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        match &attribute.meta {
            syn::Meta::List(list) if !attribute.path().is_ident("cfg") => {
                self.scan(list.tokens.clone());
                // A derive names traits or macros that an import may have brought.
                if attribute.path().is_ident("derive") {
                    let names = list.tokens.clone().into_iter().filter_map(|token| match token {
                        TokenTree::Ident(ident) => Some(vec![ident.to_string()]),
                        _ => None,
                    });
                    self.mentions.extend(names);
                }
                // serde and others name functions in strings.
                for token in list.tokens.clone() {
                    if let TokenTree::Literal(literal) = token
                        && let Ok(text) = syn::parse_str::<syn::LitStr>(&literal.to_string())
                        && let Ok(path) = text.parse::<syn::Path>()
                    {
                        self.visit_path(&path);
                    }
                }
            }
            _ => {}
        }
    }

    /// `pub(in path)` says who may see, not what is used.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}
}
