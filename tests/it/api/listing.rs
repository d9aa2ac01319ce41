//! What users of a crate can reach, item by item.

use std::collections::{BTreeMap, BTreeSet};

use quote::{ToTokens, quote};
use syn::visit::{self, Visit};
use syn::{Attribute, Fields, ImplItem, Item, ItemImpl, TraitItem, Visibility};

use super::tokens::text;
use crate::source::{ModuleId, Names, Target, Workspace, attributes, name_of};

/// Where an item is defined.
type Place = (ModuleId, String);

pub(super) struct Listing<'a> {
    workspace: &'a Workspace,
    crate_name: String,
    /// What is shown, by the public path of the module and the name of the item there.
    shown: BTreeMap<(String, String), Entry>,
    /// The public path under which each item is shown in full.
    places: BTreeMap<Place, String>,
    impls: BTreeMap<Place, Vec<(ModuleId, &'a ItemImpl)>>,
}

/// A line, and the lines below it.
#[derive(Default)]
struct Entry {
    line: String,
    /// Fields and variants, in their order.
    parts: Vec<String>,
    derives: Vec<String>,
    /// Methods, constants and implemented traits.
    members: BTreeSet<String>,
    /// Foreign items in the signatures.
    foreign: BTreeSet<Names>,
}

impl<'a> Listing<'a> {
    pub(super) fn of(workspace: &'a Workspace, crate_name: &str) -> Self {
        let root = workspace.libraries[crate_name];
        let mut listing = Self {
            workspace,
            crate_name: crate_name.to_owned(),
            shown: BTreeMap::new(),
            places: BTreeMap::new(),
            impls: BTreeMap::new(),
        };
        for (id, module) in workspace.modules.iter().enumerate().filter(|(_, module)| module.root == root) {
            for item in &module.items {
                let Item::Impl(item) = item else { continue };
                if let Some(place) = listing.subject(id, item) {
                    listing.impls.entry(place).or_default().push((id, item));
                }
            }
        }
        let mut reached = Vec::new();
        listing.reach(root, crate_name, &mut BTreeSet::new(), &mut reached);
        // The shortest path of an item is the one it is shown under.
        reached.sort_by_key(|reached: &Reached| (reached.module.matches("::").count(), reached.module.clone()));
        for reached in &reached {
            if let Some(place) = &reached.place {
                let path = format!("{}::{}", reached.module, reached.name);
                listing.places.entry(place.clone()).or_insert(path);
            }
        }
        for reached in reached {
            let entry = listing.entry(&reached);
            listing.shown.insert((reached.module, reached.name), entry);
        }
        listing
    }

    /// The listing as text: a heading per module, a line per item and per member.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        let mut heading = "";
        for ((module, _), entry) in &self.shown {
            if module != heading {
                let gap = if heading.is_empty() { "" } else { "\n" };
                text.push_str(&format!("{gap}{module}\n"));
                heading = module;
            }
            text.push_str(&format!("    {}\n", entry.line));
            let derives = (!entry.derives.is_empty()).then(|| format!("derive {}", entry.derives.join(", ")));
            for member in entry.parts.iter().chain(&derives).chain(&entry.members) {
                text.push_str(&format!("        {member}\n"));
            }
        }
        let macros = self.macros();
        if !macros.is_empty() {
            text.push_str("\nMacros that may define more:\n");
            macros.iter().for_each(|call| text.push_str(&format!("    {call}\n")));
        }
        text
    }

    /// The macros that are called as items in the modules of what is shown.
    fn macros(&self) -> BTreeSet<String> {
        let modules: BTreeSet<ModuleId> = self.places.keys().map(|(module, _)| *module).collect();
        let calls = modules.iter().map(|&id| &self.workspace.modules[id]).flat_map(|module| {
            module.items.iter().filter_map(|item| match item {
                Item::Macro(item) if item.ident.is_none() => {
                    Some(format!("{}: {}!", module.file, text(item.mac.path.to_token_stream())))
                }
                _ => None,
            })
        });
        calls.collect()
    }

    /// Public items whose signatures name something of a crate that is neither ours nor among these.
    pub(super) fn foreign(&self, allowed: &[&str]) -> Vec<String> {
        let mut found = Vec::new();
        for ((module, name), entry) in &self.shown {
            let others = entry.foreign.iter().filter(|path| !allowed.contains(&path[0].as_str()));
            found.extend(others.map(|path| format!("{module}::{name}: {}", path.join("::"))));
        }
        found
    }

    /// The item of this crate that an implementation is shown with: the first that its type names, else its trait or the
    /// first that the trait's parameters name.
    fn subject(&self, from: ModuleId, item: &ItemImpl) -> Option<Place> {
        let mut paths = Paths::default();
        paths.visit_type(&item.self_ty);
        if let Some((path, _)) = &item.trait_ {
            paths.visit_path(path);
        }
        let root = self.workspace.libraries[&self.crate_name];
        let targets = paths.found.iter().flat_map(|path| self.workspace.resolve(from, path));
        let mut places = targets.filter_map(|target| match target {
            Target::Item { module, name } if self.workspace.modules[module].root == root => Some((module, name)),
            _ => None,
        });
        places.next()
    }

    /// Collects what a public module offers, and what its public modules offer.
    fn reach(&self, id: ModuleId, path: &str, inside: &mut BTreeSet<ModuleId>, reached: &mut Vec<Reached>) {
        if !inside.insert(id) {
            return;
        }
        let module = &self.workspace.modules[id];
        for item in &module.items {
            let Some(name) = name_of(item) else { continue };
            let public = match item {
                Item::Macro(item) => module.root == id && has(&item.attrs, "macro_export"),
                item => visibility(item).is_some_and(is_public),
            };
            if public && !is_hidden(attributes(item)) {
                reached.push(Reached::item(path, &name, (id, name.clone())));
            }
        }
        for &child in &module.children {
            let child_module = &self.workspace.modules[child];
            if child_module.public && !is_hidden(&child_module.attributes) {
                let name = child_module.path.rsplit("::").next().unwrap_or_default();
                let conditions = conditions(&child_module.attributes);
                reached.push(Reached::line(path, name, format!("{conditions}pub mod {name}")));
                self.reach(child, &format!("{path}::{name}"), inside, reached);
            }
        }
        for import in module.imports.iter().filter(|import| import.public && !is_hidden(&import.attributes)) {
            let conditions = conditions(&import.attributes);
            let written = import.path.join("::");
            let line = |name: &str, as_name: &str| {
                Reached::line(path, name, format!("{conditions}pub use {written}{as_name}"))
            };
            for target in self.workspace.resolve(id, &import.path) {
                match (target, &import.name) {
                    (Target::Module(other), None) if self.workspace.modules[other].root == module.root => {
                        self.reach(other, path, inside, reached);
                    }
                    (Target::Module(other), Some(name)) if self.workspace.modules[other].root == module.root => {
                        reached.push(Reached::line(path, name, format!("{conditions}pub mod {name}")));
                        self.reach(other, &format!("{path}::{name}"), inside, reached);
                    }
                    (Target::Item { module: other, name: old }, Some(name))
                        if self.workspace.modules[other].root == module.root =>
                    {
                        let mut found = Reached::item(path, name, (other, old));
                        found.conditions = conditions.clone();
                        reached.push(found);
                    }
                    (_, None) => reached.push(line(&format!("{written}::*"), "::*")),
                    (target, Some(name)) => {
                        let as_name =
                            if import.path.last() == Some(name) { String::new() } else { format!(" as {name}") };
                        let mut found = line(name, &as_name);
                        if let Target::Foreign(path) = target {
                            found.foreign.insert(path);
                        }
                        reached.push(found);
                    }
                }
            }
        }
        inside.remove(&id);
    }

    fn entry(&self, reached: &Reached) -> Entry {
        let Some(place) = &reached.place else {
            return Entry { line: reached.line.clone(), foreign: reached.foreign.clone(), ..Entry::default() };
        };
        let path = format!("{}::{}", reached.module, reached.name);
        if self.places[place] != path {
            return Entry { line: format!("{}pub use {}", reached.conditions, self.places[place]), ..Entry::default() };
        }
        let module = &self.workspace.modules[place.0];
        let items = module.items.iter().filter(|item| name_of(item).as_deref() == Some(&place.1));
        let mut builder = Builder { listing: self, module: place.0, entry: Entry::default() };
        let mut lines = Vec::new();
        for item in items {
            lines.push(format!("{}{}", reached.conditions, builder.item(item, &reached.name)));
        }
        if lines.is_empty() {
            lines.push(format!("{}{} (made by a macro of {})", reached.conditions, reached.name, module.file));
        }
        lines.dedup();
        builder.entry.line = lines.join(" | ");
        for (from, item) in self.impls.get(place).into_iter().flatten() {
            builder.module = *from;
            builder.implementation(item);
        }
        builder.entry
    }

    /// Whether users can name an item; items of other crates of the workspace count as reachable.
    fn is_reachable(&self, target: &Target) -> bool {
        let Target::Item { module, name } = target else { return true };
        let is_own = self.workspace.modules[*module].root == self.workspace.libraries[&self.crate_name];
        !is_own || self.places.contains_key(&(*module, name.clone()))
    }
}

/// Something that users can name.
struct Reached {
    module: String,
    name: String,
    place: Option<Place>,
    conditions: String,
    line: String,
    foreign: BTreeSet<Names>,
}

impl Reached {
    fn item(module: &str, name: &str, place: Place) -> Self {
        Self { place: Some(place), ..Self::line(module, name, String::new()) }
    }

    fn line(module: &str, name: &str, line: String) -> Self {
        let foreign = BTreeSet::new();
        Self { module: module.to_owned(), name: name.to_owned(), place: None, conditions: String::new(), line, foreign }
    }
}

/// Makes the lines of one item.
struct Builder<'a> {
    listing: &'a Listing<'a>,
    module: ModuleId,
    entry: Entry,
}

impl Builder<'_> {
    /// The line of an item as it is shown under `name`; its fields, variants and derives become members.
    fn item(&mut self, item: &Item, name: &str) -> String {
        let attributes = attributes(item);
        self.derives(attributes);
        let mut start = conditions(attributes);
        for name in ["non_exhaustive", "must_use", "deprecated"] {
            if has(attributes, name) {
                start.push_str(&format!("#[{name}] "));
            }
        }
        let name = syn::Ident::new(name, proc_macro2::Span::call_site());
        let rest = match item {
            Item::Const(item) => {
                self.sees(|paths| paths.visit_type(&item.ty));
                let (ty, value) = (&item.ty, &item.expr);
                quote!(pub const #name: #ty = #value)
            }
            Item::Static(item) => {
                self.sees(|paths| paths.visit_type(&item.ty));
                let ty = &item.ty;
                quote!(pub static #name: #ty)
            }
            Item::Fn(item) => {
                self.sees(|paths| paths.visit_signature(&item.sig));
                let renamed = syn::Signature { ident: name, ..item.sig.clone() };
                return format!("{start}pub {}", signature(&renamed));
            }
            Item::Type(item) => {
                self.sees(|paths| {
                    paths.visit_generics(&item.generics);
                    paths.visit_type(&item.ty);
                });
                let (generics, ty) = (&item.generics, &item.ty);
                quote!(pub type #name #generics = #ty)
            }
            Item::Struct(item) => {
                self.sees(|paths| paths.visit_generics(&item.generics));
                self.fields(&item.fields);
                let (generics, bounds) = (&item.generics, &item.generics.where_clause);
                quote!(pub struct #name #generics #bounds)
            }
            Item::Enum(item) => {
                self.sees(|paths| paths.visit_generics(&item.generics));
                item.variants.iter().for_each(|variant| self.variant(variant));
                let (generics, bounds) = (&item.generics, &item.generics.where_clause);
                quote!(pub enum #name #generics #bounds)
            }
            Item::Trait(item) => {
                self.sees(|paths| {
                    paths.visit_generics(&item.generics);
                    item.supertraits.iter().for_each(|bound| paths.visit_type_param_bound(bound));
                });
                item.items.iter().for_each(|item| self.trait_item(item));
                let (generics, bounds) = (&item.generics, &item.generics.where_clause);
                let supertraits = &item.supertraits;
                let colon = (!supertraits.is_empty()).then(|| quote!(:));
                quote!(pub trait #name #generics #colon #supertraits #bounds)
            }
            Item::Macro(_) => quote!(macro_rules! #name),
            other => quote!(#other),
        };
        start + &text(rest)
    }

    fn fields(&mut self, fields: &Fields) {
        let mut private = false;
        for (at, field) in fields.iter().enumerate() {
            if !is_public(&field.vis) || is_hidden(&field.attrs) {
                private = true;
                continue;
            }
            self.sees(|paths| paths.visit_type(&field.ty));
            let name = field.ident.as_ref().map_or(at.to_string(), ToString::to_string);
            let ty = text(field.ty.to_token_stream());
            self.entry.parts.push(format!("{}pub {name}: {ty}", conditions(&field.attrs)));
        }
        if private {
            self.entry.parts.push("private fields".to_owned());
        }
    }

    fn variant(&mut self, variant: &syn::Variant) {
        if is_hidden(&variant.attrs) {
            return;
        }
        self.sees(|paths| variant.fields.iter().for_each(|field| paths.visit_type(&field.ty)));
        let shown = |field: &syn::Field| {
            let from = if has(&field.attrs, "from") { "#[from] " } else { "" };
            let name = field.ident.as_ref().map_or(String::new(), |name| format!("{name}: "));
            format!("{from}{name}{}", text(field.ty.to_token_stream()))
        };
        let fields: Vec<String> = variant.fields.iter().map(shown).collect();
        let fields = match &variant.fields {
            Fields::Named(_) => format!(" {{ {} }}", fields.join(", ")),
            Fields::Unnamed(_) => format!("({})", fields.join(", ")),
            Fields::Unit => String::new(),
        };
        let value =
            variant.discriminant.as_ref().map_or(String::new(), |(_, value)| format!(" = {}", text(quote!(#value))));
        let closed = if has(&variant.attrs, "non_exhaustive") { "#[non_exhaustive] " } else { "" };
        let line = format!("{}{closed}{}{fields}{value}", conditions(&variant.attrs), variant.ident);
        self.entry.parts.push(line);
    }

    fn trait_item(&mut self, item: &TraitItem) {
        let (attributes, line) = match item {
            TraitItem::Fn(item) => {
                self.sees(|paths| paths.visit_signature(&item.sig));
                let body = if item.default.is_some() { " { .. }" } else { "" };
                (&item.attrs, signature(&item.sig) + body)
            }
            TraitItem::Const(item) => {
                self.sees(|paths| paths.visit_type(&item.ty));
                let (name, ty) = (&item.ident, &item.ty);
                (&item.attrs, text(quote!(const #name: #ty)))
            }
            TraitItem::Type(item) => {
                self.sees(|paths| item.bounds.iter().for_each(|bound| paths.visit_type_param_bound(bound)));
                let (name, generics, bounds) = (&item.ident, &item.generics, &item.bounds);
                let colon = (!bounds.is_empty()).then(|| quote!(:));
                (&item.attrs, text(quote!(type #name #generics #colon #bounds)))
            }
            _ => return,
        };
        if !is_hidden(attributes) {
            self.member(conditions(attributes) + &line);
        }
    }

    /// The public members of an implementation, or one line for an implementation of a trait that users can name.
    fn implementation(&mut self, item: &ItemImpl) {
        let start = conditions(&item.attrs);
        if let Some(implemented) = &item.trait_ {
            let (path, _) = implemented;
            let names: Names = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            let targets = self.listing.workspace.resolve(self.module, &names);
            if is_hidden(&item.attrs) || !targets.iter().all(|target| self.listing.is_reachable(target)) {
                return;
            }
            self.sees(|paths| {
                paths.visit_path(path);
                paths.visit_type(&item.self_ty);
            });
            let (generics, bounds) = (&item.generics, &item.generics.where_clause);
            let ty = &item.self_ty;
            return self.member(start + &text(quote!(impl #generics #path for #ty #bounds)));
        }
        for member in &item.items {
            let (attributes, vis, line) = match member {
                ImplItem::Fn(item) => (&item.attrs, &item.vis, signature(&item.sig)),
                ImplItem::Const(item) => {
                    let (name, ty, value) = (&item.ident, &item.ty, &item.expr);
                    (&item.attrs, &item.vis, text(quote!(const #name: #ty = #value)))
                }
                _ => continue,
            };
            if !is_public(vis) || is_hidden(attributes) {
                continue;
            }
            match member {
                ImplItem::Fn(item) => self.sees(|paths| paths.visit_signature(&item.sig)),
                ImplItem::Const(item) => self.sees(|paths| paths.visit_type(&item.ty)),
                _ => {}
            }
            let must_use = if has(attributes, "must_use") { "#[must_use] " } else { "" };
            self.member(format!("{start}{}{must_use}pub {line}", conditions(attributes)));
        }
    }

    fn derives(&mut self, attributes: &[Attribute]) {
        for attribute in attributes {
            let derive = match &attribute.meta {
                syn::Meta::List(list) if list.path.is_ident("derive") => (String::new(), list.clone()),
                // #[cfg_attr(feature = "serde", derive(Serialize))]
                syn::Meta::List(list) if list.path.is_ident("cfg_attr") => {
                    let parser = syn::punctuated::Punctuated::<syn::Meta, syn::Token![,]>::parse_terminated;
                    let parts: Vec<syn::Meta> =
                        list.parse_args_with(parser).map(|parts| parts.into_iter().collect()).unwrap_or_default();
                    match parts.as_slice() {
                        [condition, syn::Meta::List(list)] if list.path.is_ident("derive") => {
                            (format!("#[cfg({})] ", text(quote!(#condition))), list.clone())
                        }
                        _ => continue,
                    }
                }
                _ => continue,
            };
            let parser = syn::punctuated::Punctuated::<syn::Path, syn::Token![,]>::parse_terminated;
            for path in derive.1.parse_args_with(parser).into_iter().flatten() {
                self.entry.derives.push(derive.0.clone() + &text(quote!(#path)));
            }
        }
    }

    fn member(&mut self, line: String) {
        self.entry.members.insert(line);
    }

    /// Records the foreign items that a signature names.
    fn sees(&mut self, look: impl FnOnce(&mut Paths)) {
        let mut paths = Paths::default();
        look(&mut paths);
        for path in &paths.found {
            for target in self.listing.workspace.resolve(self.module, path) {
                if let Target::Foreign(path) = target {
                    self.entry.foreign.insert(path);
                }
            }
        }
    }
}

/// Collects the paths of signatures.
#[derive(Default)]
struct Paths {
    found: Vec<Names>,
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_path(&mut self, path: &'ast syn::Path) {
        let leading = path.leading_colon.iter().map(|_| String::new());
        self.found.push(leading.chain(path.segments.iter().map(|segment| segment.ident.to_string())).collect());
        visit::visit_path(self, path);
    }

    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

/// A signature without the `mut` of parameters, which is the body's business.
fn signature(signature: &syn::Signature) -> String {
    let mut signature = signature.clone();
    for input in &mut signature.inputs {
        match input {
            syn::FnArg::Receiver(receiver) => receiver.mutability = None,
            syn::FnArg::Typed(typed) => {
                if let syn::Pat::Ident(pattern) = &mut *typed.pat {
                    pattern.mutability = None;
                }
            }
        }
    }
    text(signature.to_token_stream())
}

fn visibility(item: &Item) -> Option<&Visibility> {
    Some(match item {
        Item::Const(item) => &item.vis,
        Item::Enum(item) => &item.vis,
        Item::Fn(item) => &item.vis,
        Item::Static(item) => &item.vis,
        Item::Struct(item) => &item.vis,
        Item::Trait(item) => &item.vis,
        Item::TraitAlias(item) => &item.vis,
        Item::Type(item) => &item.vis,
        Item::Union(item) => &item.vis,
        _ => return None,
    })
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn has(attributes: &[Attribute], name: &str) -> bool {
    attributes.iter().any(|attribute| attribute.path().is_ident(name))
}

fn is_hidden(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("doc")
            && attribute.meta.require_list().is_ok_and(|list| list.tokens.to_string().contains("hidden"))
    })
}

/// The conditions under which an item exists, as its attributes say, each followed by a space.
fn conditions(attributes: &[Attribute]) -> String {
    let conditions = attributes.iter().filter(|attribute| attribute.path().is_ident("cfg"));
    conditions.map(|attribute| text(attribute.to_token_stream()) + " ").collect()
}
