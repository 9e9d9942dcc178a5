"""Signals from decoded fields: conversion, alarms and change filters."""
